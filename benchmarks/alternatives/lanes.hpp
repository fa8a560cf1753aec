// A number that is several samples at once, so that scalar C code, compiled as C++, computes a whole register.
#include <cmath>
#include <cstring>

#ifdef __AVX512F__
enum { LANES = 8 };
#define VECTOR_SIN _ZGVeN8v_sin
#define VECTOR_COS _ZGVeN8v_cos
#else
enum { LANES = 4 };
#define VECTOR_SIN _ZGVdN4v_sin
#define VECTOR_COS _ZGVdN4v_cos
#endif

typedef double Lanes __attribute__((vector_size(8 * LANES)));
extern "C" Lanes VECTOR_SIN(Lanes);  // from the C library's vector functions
extern "C" Lanes VECTOR_COS(Lanes);

struct Many {
  Lanes v;
  Many() = default;
  Many(Lanes a) : v(a) {}
  Many(double a) { v = a - Lanes{}; }
};

inline Many operator+(Many a, Many b) { return a.v + b.v; }
inline Many operator-(Many a, Many b) { return a.v - b.v; }
inline Many operator*(Many a, Many b) { return a.v * b.v; }
inline Many operator/(Many a, Many b) { return a.v / b.v; }
inline Many operator-(Many a) { return -a.v; }
inline Many sin(Many a) { return VECTOR_SIN(a.v); }
inline Many cos(Many a) { return VECTOR_COS(a.v); }
inline Many pow(Many a, int n) { return n == 1 ? a : a * pow(a, n - 1); }

inline Many load(const double *x) {
  Many a;
  std::memcpy(&a, x, sizeof a);
  return a;
}

inline void store(double *y, Many a) { std::memcpy(y, &a, sizeof a); }
