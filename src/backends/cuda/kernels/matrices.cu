// Products of matrices of small dense blocks in compressed rows, and block Jacobi and Chebyshev smoothing. One warp
// computes a row. The entries of a block are stored by columns; blocks of one entry are plain compressed rows. Sums
// have a fixed order.

// Lanes of a warp, and warps of a block of threads.
#define LANES 32
#define WARPS 8

// Sums of a block row: lane `i` of the warp gets that of row `i % R` of the block. A warp reads consecutive entries, so
// that a lane adds entries of one row of the block only.
template <typename T, int R, int C>
__device__ T row_sum(unsigned start, unsigned end, unsigned lane, const unsigned *columns, const T *values, const T *x) {
    constexpr unsigned GROUPS = LANES / R;
    const unsigned group = lane / R;
    const size_t first = (size_t)start * (R * C) + lane;
    const unsigned count = (end - start) * C;
    T sum = 0;
    if (group < GROUPS) {
#pragma unroll 4
        for (unsigned column = group, step = 0; column < count; column += GROUPS, ++step) {
            const T value = values[first + (size_t)step * (GROUPS * R)];
            sum += value * x[columns[start + column / C] * C + column % C];
        }
    }
    // All lanes take part in the exchange; those beyond the last group have nothing to add.
    for (unsigned offset = 16; offset > 0; offset /= 2) {
        if (offset * R < LANES) {
            const T other = __shfl_down_sync(0xffffffffu, sum, offset * R);
            if (group + offset < GROUPS) sum += other;
        }
    }
    return __shfl_sync(0xffffffffu, sum, lane % R);
}

enum Product { OVERWRITE, ADD, RESIDUAL };

// y = A x, y += A x, or y = b - A x.
template <typename T, int R, int C, Product PRODUCT>
__device__ void product(
    unsigned rows, const unsigned *offsets, const unsigned *columns, const T *values, const T *x, const T *b, T *y
) {
    const unsigned row = blockIdx.x * WARPS + threadIdx.x / LANES;
    const unsigned lane = threadIdx.x % LANES;
    if (row >= rows) return;
    const T sum = row_sum<T, R, C>(offsets[row], offsets[row + 1], lane, columns, values, x);
    if (lane >= R) return;
    const size_t at = (size_t)row * R + lane;
    if (PRODUCT == OVERWRITE) y[at] = sum;
    if (PRODUCT == ADD) y[at] += sum;
    if (PRODUCT == RESIDUAL) y[at] = b[at] - sum;
}

// One step of the Chebyshev iteration: d = alpha d + beta D^-1 (b - A x), y = x + d; `inverse` holds the inverses of
// the diagonal blocks. `d` is not read if alpha is zero.
template <typename T, int S>
__device__ void chebyshev(
    unsigned rows, const unsigned *offsets, const unsigned *columns, const T *values, const T *inverse, T alpha, T beta,
    const T *b, const T *x, T *d, T *y
) {
    const unsigned row = blockIdx.x * WARPS + threadIdx.x / LANES;
    const unsigned lane = threadIdx.x % LANES;
    if (row >= rows) return;
    const T sum = row_sum<T, S, S>(offsets[row], offsets[row + 1], lane, columns, values, x);
    const unsigned i = lane % S;
    const size_t at = (size_t)row * S + i;
    const T residual = b[at] - sum;
    T change = 0;
    for (unsigned j = 0; j < S; ++j) {
        const T other = __shfl_sync(0xffffffffu, residual, j);
        change += inverse[((size_t)row * S + j) * S + i] * other;
    }
    if (lane >= S) return;
    change = alpha == 0 ? beta * change : alpha * d[at] + beta * change;
    d[at] = change;
    y[at] = x[at] + change;
}

// The first step of the Chebyshev iteration from zero: d = y = beta D^-1 b.
template <typename T, int S>
__device__ void chebyshev_start(unsigned rows, const T *inverse, T beta, const T *b, T *d, T *y) {
    const size_t at = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (at >= (size_t)rows * S) return;
    const size_t row = at / S;
    const unsigned i = at % S;
    T change = 0;
    for (unsigned j = 0; j < S; ++j) change += inverse[(row * S + j) * S + i] * b[row * S + j];
    d[at] = beta * change;
    y[at] = beta * change;
}

// y = A^T x: the blocks of one entry of the transpose come from the positions `sources` of the matrix.
extern "C" __global__ void transposed(
    unsigned rows, const unsigned *offsets, const unsigned *columns, const unsigned *sources, const double *values,
    const double *x, double *y
) {
    const unsigned row = blockIdx.x * WARPS + threadIdx.x / LANES;
    const unsigned lane = threadIdx.x % LANES;
    if (row >= rows) return;
    double sum = 0.0;
    for (unsigned at = offsets[row] + lane; at < offsets[row + 1]; at += LANES) {
        sum += values[sources[at]] * x[columns[at]];
    }
    for (unsigned offset = LANES / 2; offset > 0; offset /= 2) sum += __shfl_down_sync(0xffffffffu, sum, offset);
    if (lane == 0) y[row] = sum;
}

// y = A x for a dense matrix by rows.
extern "C" __global__ void dense(unsigned n, const float *a, const float *x, float *y) {
    const unsigned row = blockIdx.x * WARPS + threadIdx.x / LANES;
    const unsigned lane = threadIdx.x % LANES;
    if (row >= n) return;
    double sum = 0.0;
    for (unsigned j = lane; j < n; j += LANES) sum += (double)a[(size_t)row * n + j] * x[j];
    for (unsigned offset = LANES / 2; offset > 0; offset /= 2) sum += __shfl_down_sync(0xffffffffu, sum, offset);
    if (lane == 0) y[row] = (float)sum;
}

// Copies a vector to the places of its entries in a padded one, divided by the number `unit`, if that is not zero.
extern "C" __global__ void pad_scaled(
    size_t n, const unsigned *places, const double *x, const double *unit, float *padded
) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) padded[places[i]] = *unit == 0.0 ? 0.0f : (float)(x[i] / *unit);
}

// Copies the entries of a padded vector back, times `unit / divisor`.
extern "C" __global__ void unpad_scaled(
    size_t n, const unsigned *places, const float *padded, const double *unit, double divisor, double *x
) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) x[i] = padded[places[i]] * (*unit / divisor);
}

extern "C" __global__ void pad(size_t n, const unsigned *places, const double *x, double *padded) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) padded[places[i]] = x[i];
}

extern "C" __global__ void unpad(size_t n, const unsigned *places, const double *padded, double *x) {
    const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) x[i] = padded[places[i]];
}

#define PRODUCT(T, R, C)                                                                                              \
    extern "C" __global__ void product_##T##_##R##C(                                                                  \
        unsigned rows, const unsigned *offsets, const unsigned *columns, const T *values, const T *x, T *y            \
    ) {                                                                                                               \
        product<T, R, C, OVERWRITE>(rows, offsets, columns, values, x, nullptr, y);                                   \
    }
#define PRODUCT_ADD(R, C)                                                                                             \
    extern "C" __global__ void product_add_##R##C(                                                                    \
        unsigned rows, const unsigned *offsets, const unsigned *columns, const float *values, const float *x, float *y \
    ) {                                                                                                               \
        product<float, R, C, ADD>(rows, offsets, columns, values, x, nullptr, y);                                     \
    }
#define SMOOTHER(S)                                                                                                   \
    extern "C" __global__ void residual_##S(                                                                          \
        unsigned rows, const unsigned *offsets, const unsigned *columns, const float *values, const float *x,         \
        const float *b, float *y                                                                                      \
    ) {                                                                                                               \
        product<float, S, S, RESIDUAL>(rows, offsets, columns, values, x, b, y);                                      \
    }                                                                                                                 \
    extern "C" __global__ void chebyshev_##S(                                                                         \
        unsigned rows, const unsigned *offsets, const unsigned *columns, const float *values, const float *inverse,   \
        float alpha, float beta, const float *b, const float *x, float *d, float *y                                   \
    ) {                                                                                                               \
        chebyshev<float, S>(rows, offsets, columns, values, inverse, alpha, beta, b, x, d, y);                        \
    }                                                                                                                 \
    extern "C" __global__ void chebyshev_start_##S(                                                                   \
        unsigned rows, const float *inverse, float beta, const float *b, float *d, float *y                           \
    ) {                                                                                                               \
        chebyshev_start<float, S>(rows, inverse, beta, b, d, y);                                                      \
    }
// Restrictions and prolongations between levels of these block sizes.
#define TRANSFERS(R, C) PRODUCT(float, R, C) PRODUCT_ADD(R, C)

PRODUCT(double, 1, 1)
PRODUCT(double, 3, 3)
TRANSFERS(1, 1)
TRANSFERS(1, 3)
TRANSFERS(1, 6)
TRANSFERS(3, 1)
TRANSFERS(3, 3)
TRANSFERS(3, 6)
TRANSFERS(6, 1)
TRANSFERS(6, 3)
TRANSFERS(6, 6)
SMOOTHER(1)
SMOOTHER(3)
SMOOTHER(6)
