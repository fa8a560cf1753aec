// Workloads W1, W2, W3, W4 by Pinocchio in C++: a loop over samples, data allocated once, fixed-size solves.
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/centroidal-derivatives.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/spatial.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace pin = pinocchio;
using Eigen::Map;
using Matrix3 = Eigen::Matrix3d;
using Matrix4 = Eigen::Matrix4d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Row = Map<Eigen::VectorXd>;
using ConstRow = Map<const Eigen::VectorXd>;

namespace {

struct Limb {
  pin::JointIndex last;
  int column;        // of its first joint in the velocity
  int joints;
  bool turns;        // the tip's orientation is imposed too
  pin::SE3 tip;      // in the frame of its last joint
};

struct Body {
  pin::Model model;
  pin::Data data;
  std::vector<Limb> limbs;
};

pin::SE3 pose(const double *columns) {  // columns of R, then p
  return pin::SE3(Map<const Matrix3>(columns), Map<const Vector3>(columns + 9));
}

Map<Vector3> vector(double *x) { return Map<Vector3>(x); }

void put(const pin::SE3 &M, double *columns) {
  vector(columns) = M.rotation().col(0);
  vector(columns + 3) = M.rotation().col(1);
  vector(columns + 6) = M.rotation().col(2);
  vector(columns + 9) = M.translation();
}

pin::JointIndex add_joint(pin::Model &model, pin::JointIndex parent, const Vector3 &axis,
                          const pin::SE3 &place, const std::string &name) {
  if (axis == Vector3::UnitX()) return model.addJoint(parent, pin::JointModelRX(), place, name);
  if (axis == Vector3::UnitY()) return model.addJoint(parent, pin::JointModelRY(), place, name);
  if (axis == Vector3::UnitZ()) return model.addJoint(parent, pin::JointModelRZ(), place, name);
  return model.addJoint(parent, pin::JointModelRevoluteUnaligned(axis), place, name);
}

// Closed-loop inverse kinematics by damped least squares, after Pinocchio's own example; full steps.
// Returns the iterations, or -1 where it did not arrive.
template <int Rows>
int clik(Body &body, const Limb &limb, const pin::SE3 &target, Row q, double tolerance, double damping,
         int most) {
  using Error = Eigen::Matrix<double, Rows, 1>;
  using Square = Eigen::Matrix<double, Rows, Rows>;
  thread_local Eigen::Matrix<double, 6, Eigen::Dynamic> J;
  J.setZero(6, body.model.nv);
  for (int step = 0; step <= most; ++step) {
    pin::forwardKinematics(body.model, body.data, q);
    const pin::SE3 here = body.data.oMi[limb.last] * limb.tip;
    Error error;
    pin::SE3 gap;
    if constexpr (Rows == 6) {
      gap = here.actInv(target);
      error = pin::log6(gap).toVector();
    } else {
      error = here.rotation().transpose() * (target.translation() - here.translation());
    }
    if (error.norm() <= tolerance) return step;
    if (step == most) break;
    pin::computeJointJacobian(body.model, body.data, q, limb.last, J);
    const auto joints = J.middleCols(limb.column, limb.joints);
    const Matrix6 down = limb.tip.toActionMatrixInverse();
    Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, Rows, 8> A;
    if constexpr (Rows == 6) {
      Matrix6 Jlog;
      pin::Jlog6(gap.inverse(), Jlog);
      A.noalias() = (Jlog * down).eval() * joints;
    } else {
      A.noalias() = down.topRows<3>() * joints;
    }
    Square lifted = A * A.transpose();
    lifted.diagonal().array() += damping;
    // A floating base has one coordinate more than freedoms: its quaternion.
    q.segment(body.model.nq - body.model.nv + limb.column, limb.joints) +=
        A.transpose() * lifted.ldlt().solve(error);
  }
  return -1;
}

}  // namespace

extern "C" {

// A robot: joints in order, each child told by parent (-1: base), axis, place, mass, centre, inertia.
void *make(int floating, int joints, const int *parent, const double *axis, const double *place,
           const double *mass, const double *centre, const double *inertia, int limbs, const int *last,
           const int *first, const int *count, const int *turns, const double *tip) {
  auto *body = new Body;
  pin::Model &model = body->model;
  pin::JointIndex base = 0;
  if (floating) base = model.addJoint(0, pin::JointModelFreeFlyer(), pin::SE3::Identity(), "base");
  std::vector<pin::JointIndex> ids;
  for (int i = 0; i <= joints; ++i) {  // body 0 is the base, body i the child of joint i - 1
    pin::JointIndex id = base;
    if (i > 0) {
      const pin::SE3 at(Matrix3::Identity(), Map<const Vector3>(place + 3 * (i - 1)));
      const pin::JointIndex on = parent[i - 1] < 0 ? base : ids[parent[i - 1]];
      id = add_joint(model, on, Map<const Vector3>(axis + 3 * (i - 1)), at, std::to_string(i));
      ids.push_back(id);
    }
    const double *I = inertia + 6 * i;
    Matrix3 rotational;
    rotational << I[0], I[3], I[4], I[3], I[1], I[5], I[4], I[5], I[2];
    if (id > 0 && mass[i] > 0)
      model.appendBodyToJoint(id, pin::Inertia(mass[i], Map<const Vector3>(centre + 3 * i), rotational));
  }
  model.gravity.linear() << 0, 0, -9.81;
  for (int k = 0; k < limbs; ++k)
    body->limbs.push_back({ids[last[k]], first[k] + (floating ? 6 : 0), count[k], turns[k] != 0,
                           pose(tip + 12 * k)});
  body->data = pin::Data(model);
  return body;
}

void forward(void *robot, const double *q, double *out, long n) {
  Body &body = *static_cast<Body *>(robot);
  const int nq = body.model.nq, tips = int(body.limbs.size());
  for (long k = 0; k < n; ++k, q += nq, out += 12 * tips) {
    pin::forwardKinematics(body.model, body.data, ConstRow(q, nq));
    for (int i = 0; i < tips; ++i) put(body.data.oMi[body.limbs[i].last] * body.limbs[i].tip, out + 12 * i);
  }
}

// W1: tip poses and joint rates. motions: [omega; v] of the base at its origin, then [omega; v] or v per tip.
void rates(void *robot, const double *q, const double *motions, double *out, long n, int motion_size) {
  Body &body = *static_cast<Body *>(robot);
  const int nq = body.model.nq, joints = body.model.nv - 6, tips = int(body.limbs.size());
  for (long k = 0; k < n; ++k, q += nq, motions += motion_size, out += 12 * tips + joints) {
    pin::computeJointJacobians(body.model, body.data, ConstRow(q, nq));  // positions and Jacobian in one pass
    const Vector3 base = Map<const Vector3>(q), spin = Map<const Vector3>(motions);
    const Vector3 base_v = Map<const Vector3>(motions + 3);
    const double *given = motions + 6;
    double *qd = out + 12 * tips - 6;
    for (int i = 0; i < tips; ++i) {
      const Limb &limb = body.limbs[i];
      const pin::SE3 tip = body.data.oMi[limb.last] * limb.tip;
      put(tip, out + 12 * i);
      const Vector3 p = tip.translation();
      const Vector3 carried = base_v + spin.cross(p - base);
      if (limb.turns) {
        Vector6 right;
        const Vector3 omega = Map<const Vector3>(given) - spin;
        const Vector3 v = Map<const Vector3>(given + 3) - carried;
        right << v - omega.cross(p), omega;  // told at the world origin, as the columns are
        const Matrix6 A = body.data.J.middleCols<6>(limb.column);
        Map<Vector6>(qd + limb.column) = A.partialPivLu().solve(right);
        given += 6;
      } else {
        Matrix3 A;
        for (int j = 0; j < 3; ++j) {
          const auto column = body.data.J.col(limb.column + j);
          A.col(j) = column.head<3>() + column.tail<3>().cross(p);
        }
        Map<Vector3>(qd + limb.column) = A.partialPivLu().solve(Map<const Vector3>(given) - carried);
        given += 3;
      }
    }
  }
}

// W2, W3: joint positions of all limbs for poses of base and tips; q is guess and result.
// Where `follow` is set, a sample starts from the one before. Iterations per sample and limb; -1: not arrived.
void positions(void *robot, const double *targets, double *q, int *iterations, long n, int follow,
               double tolerance, double damping, int most) {
  Body &body = *static_cast<Body *>(robot);
  const int nq = body.model.nq, tips = int(body.limbs.size());
  for (long k = 0; k < n; ++k, q += nq) {
    const int held = nq > body.model.nv ? 7 : 0;  // the base's coordinates are given
    if (follow && k > 0) Row(q + held, nq - held) = Row(q + held - nq, nq - held);
    for (int i = 0; i < tips; ++i, targets += 12) {
      const Limb &limb = body.limbs[i];
      const pin::SE3 wanted = pose(targets);
      iterations[k * tips + i] =
          limb.turns ? clik<6>(body, limb, wanted, Row(q, nq), tolerance, damping, most)
                     : clik<3>(body, limb, wanted, Row(q, nq), tolerance, damping, most);
    }
  }
}

// W4: centre of mass, momentum [angular; linear] about it, and ZMP, from positions, rates and accelerations.
void balance(void *robot, const double *q, const double *v, const double *a, double *out, long n) {
  Body &body = *static_cast<Body *>(robot);
  const int nq = body.model.nq, nv = body.model.nv;
  const double weight = 9.81 * pin::computeTotalMass(body.model);
  for (long k = 0; k < n; ++k, q += nq, v += nv, a += nv, out += 11) {
    pin::computeCentroidalMomentumTimeVariation(body.model, body.data, ConstRow(q, nq), ConstRow(v, nv),
                                                ConstRow(a, nv));
    const Vector3 c = body.data.com[0];
    const Vector3 force = body.data.dhg.linear() + Vector3(0, 0, weight);
    const Vector3 moment = body.data.dhg.angular() + c.cross(force);
    vector(out) = c;
    vector(out + 3) = body.data.hg.angular();
    vector(out + 6) = body.data.hg.linear();
    out[9] = -moment.y() / force.z();
    out[10] = moment.x() / force.z();
  }
}

void unmake(void *robot) { delete static_cast<Body *>(robot); }
}
