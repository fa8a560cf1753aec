/* XLA's handler around a program in C; large batches are shared among the threads of XLA's own pool. It stands
   below the program's source and these definitions:
   INPUTS, OUTPUTS              how many arrays
   SIZES_IN, SIZES_OUT          scalars a sample of each
   PROGRAM(samples, in, out)    the program's function, its arrays shifted
   HANDLER                      the handler's name */

#include <stdint.h>
#include <stdlib.h>
#ifdef __linux__
#include <sys/mman.h>
#endif
#include "xla/ffi/api/c_api.h"

#define SHARE 2048 /* samples worth a thread of their own */

typedef struct Job Job;

typedef struct {
    Job *job;
    size_t begin, end;
} Part;

struct Job {
    const real *in[INPUTS];
    real *out[OUTPUTS];
    const XLA_FFI_Api *api;
    XLA_FFI_Future *future;
    int left;
    Part parts[];
};

static void compute(const Job *job, size_t begin, size_t end)
{
    static const size_t sizes_in[] = SIZES_IN, sizes_out[] = SIZES_OUT;
    const real *in[INPUTS];
    real *out[OUTPUTS];
    for (size_t k = 0; k < INPUTS; ++k)
        in[k] = job->in[k] + begin * sizes_in[k];
    for (size_t k = 0; k < OUTPUTS; ++k)
        out[k] = job->out[k] + begin * sizes_out[k];
    PROGRAM(end - begin, in, out);
}

static void finish(void *data)
{
    Job *job = ((Part *)data)->job;
    compute(job, ((Part *)data)->begin, ((Part *)data)->end);
    if (__atomic_sub_fetch(&job->left, 1, __ATOMIC_ACQ_REL) == 0) {
        XLA_FFI_Future_SetAvailable_Args done = {
            XLA_FFI_Future_SetAvailable_Args_STRUCT_SIZE, NULL, job->future};
        job->api->XLA_FFI_Future_SetAvailable(&done);
        free(job);
    }
}

static int succeeded(const XLA_FFI_Api *api, XLA_FFI_Error *error)
{
    if (error) {
        XLA_FFI_Error_Destroy_Args spent = {XLA_FFI_Error_Destroy_Args_STRUCT_SIZE, NULL, error};
        api->XLA_FFI_Error_Destroy(&spent);
    }
    return !error;
}

/* XLA's results are fresh memory, which the system maps page by page as it is written. */
static void in_large_pages(real *at, size_t count)
{
#ifdef MADV_HUGEPAGE
    const uintptr_t page = (uintptr_t)1 << 21;
    const uintptr_t begin = ((uintptr_t)at + page - 1) / page * page, end = (uintptr_t)(at + count) / page * page;
    if (begin < end)
        (void)madvise((void *)begin, end - begin, MADV_HUGEPAGE); /* if it is refused, pages stay small */
#else
    (void)at, (void)count;
#endif
}

static size_t threads(const XLA_FFI_CallFrame *call)
{
    int64_t count = 1;
    XLA_FFI_ThreadPool_NumThreads_Args asked = {
        XLA_FFI_ThreadPool_NumThreads_Args_STRUCT_SIZE, NULL, call->ctx, &count};
    const int known = succeeded(call->api, call->api->XLA_FFI_ThreadPool_NumThreads(&asked));
    return known && count > 1 ? (size_t)count : 1;
}

XLA_FFI_Error *HANDLER(XLA_FFI_CallFrame *call)
{
    static const size_t sizes[] = SIZES_OUT;
    if (call->extension_start && call->extension_start->type == XLA_FFI_Extension_Metadata) {
        XLA_FFI_Metadata *metadata = ((XLA_FFI_Metadata_Extension *)call->extension_start)->metadata;
        metadata->api_version.major_version = XLA_FFI_API_MAJOR;
        metadata->api_version.minor_version = XLA_FFI_API_MINOR;
        return NULL;
    }
    Job one = {.api = call->api};
    for (size_t k = 0; k < INPUTS; ++k)
        one.in[k] = ((XLA_FFI_Buffer *)call->args.args[k])->data;
    for (size_t k = 0; k < OUTPUTS; ++k)
        one.out[k] = ((XLA_FFI_Buffer *)call->rets.rets[k])->data;
    const XLA_FFI_Buffer *first = call->rets.rets[0];
    size_t samples = 1;
    for (int64_t d = 0; d < first->rank; ++d)
        samples *= (size_t)first->dims[d];
    samples /= sizes[0];
    for (size_t k = 0; k < OUTPUTS; ++k)
        in_large_pages(one.out[k], samples * sizes[k]);
    const size_t worth = samples / SHARE, pool = worth > 1 ? threads(call) : 1;
    const size_t parts = worth < pool ? worth : pool;
    XLA_FFI_Future_Create_Args made = {XLA_FFI_Future_Create_Args_STRUCT_SIZE, NULL, NULL};
    Job *job = parts > 1 ? malloc(sizeof(Job) + parts * sizeof(Part)) : NULL;
    if (!job || !succeeded(call->api, call->api->XLA_FFI_Future_Create(&made))) {
        free(job);
        compute(&one, 0, samples);
        return NULL;
    }
    *job = one;
    job->future = call->future = made.future;
    job->left = (int)parts;
    for (size_t k = 0; k < parts; ++k)
        job->parts[k] = (Part){job, samples * k / parts, samples * (k + 1) / parts};
    for (size_t k = 1; k < parts; ++k) {
        XLA_FFI_ThreadPool_Schedule_Args task = {
            XLA_FFI_ThreadPool_Schedule_Args_STRUCT_SIZE, NULL, call->ctx, finish, &job->parts[k]};
        if (!succeeded(call->api, call->api->XLA_FFI_ThreadPool_Schedule(&task)))
            finish(&job->parts[k]);
    }
    finish(&job->parts[0]);
    return NULL;
}
