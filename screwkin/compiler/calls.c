/* Calls of compiled programs from Python, at a fraction of what a foreign function costs: two builtins.

   They use the stable ABIs of CPython and NumPy alone, of which what is needed is declared here, so that no headers
   are needed; calls.py tries the layout of arrays out before. A builtin's self is a tuple: its plan (bytes), then
   what it needs of Python. */

#include <pthread.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef ptrdiff_t ssize;
typedef struct object {
    ssize references;
    struct object *type;
} object;
typedef void (*kernel)(size_t samples, double *const *arrays);

extern object _Py_NoneStruct;
object *PyTuple_New(ssize);
object *PyTuple_GetItem(object *, ssize);
int PyTuple_SetItem(object *, ssize, object *);
ssize PyTuple_Size(object *);
char *PyBytes_AsString(object *);
object *PyObject_CallFunctionObjArgs(object *, ...);
object *PyLong_FromSsize_t(ssize);
double PyFloat_AsDouble(object *);
void Py_IncRef(object *);
void Py_DecRef(object *);
void *PyEval_SaveThread(void);
void PyEval_RestoreThread(void *);

enum { MOST = 64, BLOCK = 256, AXES = 64, ALONE = 64, NOARGS = 4, FASTCALL = 128 };
/* Arrays of a program; samples whose guards are looked at together; axes of an array; samples up to which
   others wait, as letting go of the interpreter takes as long; how CPython calls a builtin. */

/* What a call is about; in front of the sizes of all arrays, and of the axes and shapes of all but the guard. */
typedef struct {
    kernel many, one;
    double limit; /* of the guard, the last output, which has no array */
    ssize cores, shared_from, guarded, inputs, outputs, numbers[];
} plan;

typedef struct {
    const plan *of;
    double *arrays[MOST];
    ssize steps[MOST]; /* numbers from one sample to the next */
    ssize count;
    int good;
} part;

/* Compute samples; bad where a guard is not within the limit. */
static void *compute(void *given)
{
    part *own = given;
    const plan *p = own->of;
    const ssize arrays = p->inputs + p->outputs;
    double guards[2 * BLOCK];
    own->good = 1;
    if (!p->guarded) {
        (own->count == 1 ? p->one : p->many)((size_t)own->count, own->arrays);
        return NULL;
    }
    own->arrays[arrays] = guards;
    for (ssize left = own->count, count; left > 0; left -= count) {
        count = left < 2 * BLOCK ? left : BLOCK; /* the last ones are not few */
        (count == 1 ? p->one : p->many)((size_t)count, own->arrays);
        for (ssize i = 0; i < count; ++i)
            own->good &= guards[i] <= p->limit;
        for (ssize k = 0; k < arrays; ++k)
            own->arrays[k] += count * own->steps[k];
    }
    return NULL;
}

/* The same on several cores, and while other threads of Python run, where there is enough to do. */
static int computed(part *all)
{
    const plan *p = all->of;
    const ssize cores = all->count < p->shared_from ? 1 : p->cores < MOST ? p->cores : MOST;
    part parts[MOST];
    pthread_t threads[MOST];
    int running[MOST], good = 1;
    void *python = all->count > ALONE ? PyEval_SaveThread() : NULL;
    for (ssize c = cores - 1; c >= 0; --c) {
        const ssize first = all->count * c / cores;
        part *own = cores == 1 ? all : &parts[c];
        if (own != all) {
            own->of = p;
            own->count = all->count * (c + 1) / cores - first;
            for (ssize k = 0; k < p->inputs + p->outputs; ++k) {
                own->steps[k] = all->steps[k];
                own->arrays[k] = all->arrays[k] + first * all->steps[k];
            }
        }
        running[c] = c && pthread_create(&threads[c], NULL, compute, own) == 0;
        if (!running[c])
            compute(own);
    }
    for (ssize c = 0; c < cores; ++c) {
        if (running[c])
            pthread_join(threads[c], NULL);
        good &= (cores == 1 ? all : &parts[c])->good;
    }
    if (python)
        PyEval_RestoreThread(python);
    return good;
}

/* NumPy's arrays, and their flags. */
typedef struct {
    object head;
    double *data;
    int axes;
    ssize *shape, *strides;
    object *base, *dtype;
    int flags;
} array;

enum { CONTIGUOUS = 1, ALIGNED = 0x100, WRITABLE = 0x400 };

/* What arrays must be, and the batch in front of their inner axes, which the first that has one decides. */
typedef struct {
    object *type, *dtype;
    int flags;
    ssize axes, batch[AXES];
} kind;

/* Where the doubles of an array lie, which has the batch or is one sample; NULL if it is not of the kind. */
static double *doubles(object *given, kind *wanted, const ssize *inner, ssize axes)
{
    const array *x = (const array *)given;
    if (given->type != wanted->type || x->dtype != wanted->dtype || (x->flags & wanted->flags) != wanted->flags)
        return NULL;
    const ssize before = x->axes - axes;
    if (before < 0 || x->axes > AXES || memcmp(inner, x->shape + before, (size_t)axes * sizeof(ssize)))
        return NULL;
    if (before && !wanted->axes) {
        wanted->axes = before;
        memcpy(wanted->batch, x->shape, (size_t)before * sizeof(ssize));
    }
    if (before && (before != wanted->axes || memcmp(wanted->batch, x->shape, (size_t)before * sizeof(ssize))))
        return NULL;
    return x->data;
}

/* Samples that all inputs of one sample are repeated for: as many as are computed together. Their memory, or NULL. */
static double *repeated(part *all, const int *alone)
{
    const plan *p = all->of;
    const ssize rows = all->count < 2 * BLOCK ? all->count : 2 * BLOCK;
    ssize size = 0;
    for (ssize k = 0; k < p->inputs; ++k)
        size += alone[k] ? p->numbers[k] : 0;
    double *memory = malloc((size_t)(rows * size) * sizeof(double)), *at = memory;
    for (ssize k = 0; memory && k < p->inputs; ++k) {
        if (!alone[k])
            continue;
        for (ssize i = 0; i < rows; ++i)
            memcpy(at + i * p->numbers[k], all->arrays[k], (size_t)p->numbers[k] * sizeof(double));
        all->arrays[k] = at;
        all->steps[k] = 0;
        at += rows * p->numbers[k];
    }
    return memory;
}

static object *none(void)
{
    Py_IncRef(&_Py_NoneStruct);
    return &_Py_NoneStruct;
}

/* Outputs of inputs, as a tuple; None of anything that is not plain, or that the guard objects to.

   self: plan, ndarray, dtype("float64"), float, numpy.empty, the outputs' shapes, and a function from a batch to a
   tuple of arrays for the outputs. */
static object *checked(object *self, object *const *given, ssize count)
{
    const plan *p = (const plan *)PyBytes_AsString(PyTuple_GetItem(self, 0));
    const ssize *axes = p->numbers + p->inputs + p->outputs, *shape = axes + p->inputs + p->outputs;
    kind wanted = {.axes = 0, .flags = CONTIGUOUS | ALIGNED};
    double scalars[MOST], *memory = NULL;
    int alone[MOST], repeat = 0;
    part all = {.of = p, .count = 1};
    wanted.type = PyTuple_GetItem(self, 1);
    wanted.dtype = PyTuple_GetItem(self, 2);
    if (count != p->inputs)
        return none();
    for (ssize k = 0; k < count; shape += axes[k++]) {
        alone[k] = 1;
        if (given[k]->type == PyTuple_GetItem(self, 3) && axes[k] == 0) {
            scalars[k] = PyFloat_AsDouble(given[k]);
            all.arrays[k] = &scalars[k];
        } else {
            all.arrays[k] = doubles(given[k], &wanted, shape, axes[k]);
            alone[k] = all.arrays[k] && ((const array *)given[k])->axes == axes[k];
        }
        if (!all.arrays[k])
            return none();
        repeat |= alone[k];
    }
    memcpy(all.steps, p->numbers, (size_t)(p->inputs + p->outputs) * sizeof(ssize));
    for (ssize a = 0; a < wanted.axes; ++a)
        all.count *= wanted.batch[a];
    if (count == 0 || all.count == 0)
        return none();

    object *outputs;
    if (wanted.axes == 0) {
        object *empty = PyTuple_GetItem(self, 4), *shapes = PyTuple_GetItem(self, 5);
        outputs = PyTuple_New(p->outputs);
        for (ssize k = 0; outputs && k < p->outputs; ++k) {
            object *one = PyObject_CallFunctionObjArgs(empty, PyTuple_GetItem(shapes, k), NULL);
            if (!one || PyTuple_SetItem(outputs, k, one)) {
                Py_DecRef(outputs);
                outputs = NULL;
            }
        }
    } else {
        object *whole = PyTuple_New(wanted.axes);
        for (ssize a = 0; whole && a < wanted.axes; ++a)
            PyTuple_SetItem(whole, a, PyLong_FromSsize_t(wanted.batch[a]));
        outputs = whole ? PyObject_CallFunctionObjArgs(PyTuple_GetItem(self, 6), whole, NULL) : NULL;
        if (whole)
            Py_DecRef(whole);
    }
    if (!outputs)
        return NULL;
    int good = PyTuple_Size(outputs) == p->outputs;
    wanted.flags |= WRITABLE;
    for (ssize k = 0; good && k < p->outputs; ++k) {
        const ssize at = p->inputs + k;
        object *one = PyTuple_GetItem(outputs, k);
        all.arrays[at] = doubles(one, &wanted, shape, axes[at]);
        shape += axes[at];
        good = all.arrays[at] && ((const array *)one)->axes == wanted.axes + axes[at];
    }
    if (good && repeat && wanted.axes)
        good = (memory = repeated(&all, alone)) != NULL;
    good = good && computed(&all);
    free(memory);
    if (good)
        return outputs;
    Py_DecRef(outputs);
    return none();
}

/* The program on the same arrays. self: plan, addresses of all arrays (bytes), number of samples (bytes). */
static object *again(object *self, object *unused)
{
    part all = {.of = (const plan *)PyBytes_AsString(PyTuple_GetItem(self, 0))};
    (void)unused;
    memcpy(all.arrays, PyBytes_AsString(PyTuple_GetItem(self, 1)),
           (size_t)(all.of->inputs + all.of->outputs) * sizeof(double *));
    memcpy(&all.count, PyBytes_AsString(PyTuple_GetItem(self, 2)), sizeof(ssize));
    memcpy(all.steps, all.of->numbers, (size_t)(all.of->inputs + all.of->outputs) * sizeof(ssize));
    computed(&all);
    return none();
}

typedef object *(*builtin)(object *, object *);

static struct {
    const char *name;
    builtin function;
    int flags;
    const char *doc;
} methods[] = {
    {"computed", (builtin)(void (*)(void))checked, FASTCALL, "Outputs of inputs; None if the general way has to look at them."},
    {"again", again, NOARGS, "Compute anew."},
};

/* What PyCFunction_NewEx makes a builtin of: 0 checked, 1 again. */
void *screwkin_method(int which)
{
    return &methods[which];
}
