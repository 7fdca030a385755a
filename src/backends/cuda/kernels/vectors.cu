// Operations of vectors. The tree of a sum depends only on the length of the vectors, so that results are repeatable.

// Threads of a block of a reduction; a power of two.
#define THREADS 256

extern "C" __global__ void axpy(size_t n, double a, const double *x, double *y) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) y[i] += a * x[i];
}

// y = a x + b y; y is not read if b is zero.
extern "C" __global__ void axpby(size_t n, double a, const double *x, double b, double *y) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) y[i] = b == 0.0 ? a * x[i] : b * y[i] + a * x[i];
}

extern "C" __global__ void multiply(size_t n, const double *d, const double *x, double *y) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) y[i] = x[i] * d[i];
}

struct Sum {
    static __device__ double of(double x, double y) { return x + y; }
};

struct Largest {
    static __device__ double of(double x, double y) { return fmax(x, y); }
};

// Combines the values of the threads of a block; the first thread gets the result.
template <typename Operation>
__device__ double reduce_block(double value) {
    __shared__ double values[THREADS];
    const unsigned thread = threadIdx.x;
    values[thread] = value;
    for (unsigned half = THREADS / 2; half > 0; half /= 2) {
        __syncthreads();
        if (thread < half) values[thread] = Operation::of(values[thread], values[thread + half]);
    }
    return values[0];
}

// Combines the values of all threads of the grid: the block that ends last combines those of all blocks. `ticket`
// counts the blocks that have ended; it is zero before and after.
template <typename Operation>
__device__ void reduce_grid(double value, double *partial, unsigned *ticket, double *result) {
    __shared__ bool is_last;
    value = reduce_block<Operation>(value);
    if (threadIdx.x == 0) {
        partial[blockIdx.x] = value;
        __threadfence();
        is_last = atomicAdd(ticket, 1u) == gridDim.x - 1;
    }
    __syncthreads();
    if (!is_last) return;
    __threadfence();
    value = 0.0;
    for (unsigned block = threadIdx.x; block < gridDim.x; block += THREADS) {
        value = Operation::of(value, ((volatile double *)partial)[block]);
    }
    value = reduce_block<Operation>(value);
    if (threadIdx.x == 0) {
        *result = value;
        *ticket = 0;
    }
}

extern "C" __global__ void dot(
    size_t n, const double *x, const double *y, double *partial, unsigned *ticket, double *result
) {
    double sum = 0.0;
    const size_t stride = gridDim.x * (size_t)THREADS;
    for (size_t i = blockIdx.x * (size_t)THREADS + threadIdx.x; i < n; i += stride) sum += x[i] * y[i];
    reduce_grid<Sum>(sum, partial, ticket, result);
}

// The largest absolute value; NaN counts as zero.
extern "C" __global__ void largest(size_t n, const double *x, double *partial, unsigned *ticket, double *result) {
    double most = 0.0;
    const size_t stride = gridDim.x * (size_t)THREADS;
    for (size_t i = blockIdx.x * (size_t)THREADS + threadIdx.x; i < n; i += stride) most = fmax(most, fabs(x[i]));
    reduce_grid<Largest>(most, partial, ticket, result);
}
