// Equilibria of many fiber networks with the same connectivity, one thread a network.
//
// A thread is a lane: the 32 lanes of a warp execute the same operations on 32 networks, in the order of the schedule
// that the host made from the elimination order. Arrays of numbers per network are stored in tiles of 32 networks,
// entry after entry, so that a warp reads and writes 256 contiguous bytes.
//
// The file is CUDA C++ for NVRTC; with EMULATE defined, it is C++ for the processor, where tests run the same source.
//
// Interior nodes are numbered by their place in the elimination order; boundary nodes follow them.

typedef unsigned u32;
typedef unsigned long long u64;

#ifdef EMULATE
#include <cmath>
#include <cstring>
#define DEVICE static inline
#define RESTRICT
// Each kernel becomes a function that executes all threads in turn.
#define KERNEL(name)                                                                                                   \
    static void name##_thread(const Uniform &u, u64 thread);                                                           \
    extern "C" void name(const Uniform *u, u64 threads) {                                                              \
        for (u64 thread = 0; thread < threads; thread++) name##_thread(*u, thread);                                    \
    }                                                                                                                  \
    static void name##_thread(const Uniform &u, u64 thread)
#define THREAD thread
DEVICE double add(double a, double b) { return a + b; }
DEVICE double multiply(double a, double b) { return a * b; }
DEVICE double near_inverse_root(double x) { return 1.0f / std::sqrt((float)x); }
DEVICE u64 bits_of(double x) {
    u64 bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}
DEVICE double from_bits(u64 bits) {
    double x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
using std::fma, std::fabs, std::floor, std::fmax, std::fmin, std::isfinite, std::sqrt;
#else
#define KERNEL(name) extern "C" __global__ void __launch_bounds__(BLOCK_THREADS) name(const Uniform u)
#define DEVICE __device__ __forceinline__
#define RESTRICT __restrict__
#define THREAD ((u64)blockIdx.x * blockDim.x + threadIdx.x)
DEVICE double add(double a, double b) { return __dadd_rn(a, b); }
DEVICE double multiply(double a, double b) { return __dmul_rn(a, b); }
// About 22 bits of 1 / sqrt(x).
DEVICE double near_inverse_root(double x) {
    double root;
    asm("rsqrt.approx.ftz.f64 %0, %1;" : "=d"(root) : "d"(x));
    return root;
}
DEVICE u64 bits_of(double x) { return __double_as_longlong(x); }
DEVICE double from_bits(u64 bits) { return __longlong_as_double(bits); }
#endif

// Lanes of a tile.
#define LANES 32
// The factor is computed in tiles of COLUMNS block columns, ROWS block rows at a time, whose sums are in registers; the
// schedule is made for these numbers.
#ifndef ROWS
#define COLUMNS 3
#define ROWS 2
#endif
#define INNER (COLUMNS * (COLUMNS - 1) / 2)
// The index that denotes no block, no edge.
#define NONE 0xffffffffu
// Residual norms that the line search compares with, at most.
#define MEMORY 8
// Strain modes.
#define MODES 6


// What is the same for all networks of a batch. The layout is that of `Uniform` in `layout.rs`.
struct Uniform {
    // The network.
    const u32 *fiber_ends;        // two nodes a fiber
    const double *fiber_sizes;    // FIBER_LEN numbers a fiber: length and its inverse, area, area over length, volume
    const u32 *fiber_laws;        // a law a fiber
    const double *laws;           // LAW_LEN numbers a law
    const double *boundary;       // three reference coordinates a boundary node
    const u32 *incidents;         // INCIDENT_LEN numbers for each end of a fiber at a node, node after node
    // The schedule; `schedule.rs` describes the three lists.
    const u32 *factor;
    const u32 *forward;
    const u32 *backward;
    const u32 *order;             // by place in the elimination order: the interior node in the caller's numbering
    // The networks in the caller's numbering, one after the other.
    double *caller_gradients;     // 9
    double *caller_positions;     // 3 interior
    float *caller_sensitivities;  // 18 interior, or null
    double *caller_targets;       // 9
    double *caller_reached;       // 3 interior, or null
    double *caller_results;       // RESULT_LEN
    // The networks, by tiles.
    double *gradients;            // 9: the deformation gradients of the states
    double *positions;            // 3 interior: the interior positions of the states
    float *sensitivities;         // 18 interior, or null
    double *has_sensitivities;    // 1: whether the start may be predicted from them
    double *targets;              // 9: the gradients to reach
    double *reached;              // 3 interior: the equilibria to which Newton must lead, or null
    double *results;              // RESULT_LEN
    // Scratch memory, by tiles of threads.
    double *trial;                // 3 interior: positions
    double *direction;            // 3 interior: residual, then direction
    double *stiffness;            // 6 interior: diagonal blocks of the stiffness
    double *edges;                // 6 for each pair of coupled interior nodes: the negative of its block
    double *diagonal;             // 6 interior: inverses of the diagonal blocks of the factor
    double *lower;                // 9 a block: the factor below the diagonal, and a last block of zeros
    double *modes;                // 18 interior
    // Counts and parameters.
    u64 networks;
    u64 first;                    // the first network of this launch
    u32 interior, nodes, fibers, blocks, pairs, tiles;
    u32 inner_ends, ends;         // ends of fibers at interior nodes, and at all nodes
    u32 max_iterations, max_backtracks, memory, wants_tangent;
    double tolerance, floor, sufficient_decrease, excessive_force;
};

// An end of a fiber at a node: this node, the node at the other end, the fiber, the pair of interior nodes to which the
// block of the fiber is added (NONE if that is done at the other end, or the other node is on the boundary), whether the
// fiber is the first of this pair, and whether the end is the last of its node.
#define INCIDENT_LEN 6
#define NEAR 0
#define FAR 1
#define FIBER 2
#define PAIR 3
#define IS_FIRST 4
#define IS_LAST 5

#define FIBER_LEN 5

// Numbers of a law: kind, modulus, nonlinearity, transition; then whether it buckles, residual stiffness, strain; modulus
// over nonlinearity, and the inverses of modulus and strain. ONLY_LAW is the kind of all laws if none buckles.
#define LAW_LEN 10
#define LAW_LINEAR 0
#define LAW_EXPONENTIAL 1
#define LAW_EXPONENTIAL_STRETCH 2

// Fibers that are evaluated side by side, so that one does not wait for the arithmetic of the other.
#define AT_ONCE 2

// Numbers of a result.
#define STATUS 0
#define ITERATIONS 1
#define BACKTRACKS 2
#define RESIDUAL 3
#define SCALE 4
#define PIVOT_RATIO 5
#define ENERGY 6
#define IMBALANCE 7
#define STRESS 8
#define FORM 17
#define RESULT_LEN 71

// The outcome of a network, as in `Status` of `layout.rs`. Any outcome but the first two leaves the state unchanged.
#define CONVERGED 0
#define CONTINUES 1
#define INDEFINITE 2
#define LINE_SEARCH 3
#define TOO_MANY_ITERATIONS 4
#define NOT_FINITE 5
#define EXCESSIVE_FORCE 6
#define INACCURATE_TANGENT 7
#define INCONCLUSIVE 8

// The pivot ratio below which a matrix counts as singular up to rounding.
#define SINGULAR 1e-12
// Interior force sensitivities, relative to those at all nodes, at which the sensitivities are accurate.
#define ACCURATE 1e-8

// A 3x3 matrix, row by row.
struct Matrix3 {
    double a[9];
};

DEVICE void multiply(const double *m, const double *x, double *y) {
#pragma unroll
    for (int i = 0; i < 3; i++) y[i] = m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2];
}

DEVICE Matrix3 product(const Matrix3 &a, const Matrix3 &b) {
    Matrix3 c;
#pragma unroll
    for (int i = 0; i < 3; i++)
#pragma unroll
        for (int j = 0; j < 3; j++)
            c.a[3 * i + j] = a.a[3 * i] * b.a[j] + a.a[3 * i + 1] * b.a[3 + j] + a.a[3 * i + 2] * b.a[6 + j];
    return c;
}

DEVICE Matrix3 inverse(const Matrix3 &m) {
    const double *a = m.a;
    Matrix3 c;
    c.a[0] = a[4] * a[8] - a[5] * a[7];
    c.a[1] = a[2] * a[7] - a[1] * a[8];
    c.a[2] = a[1] * a[5] - a[2] * a[4];
    c.a[3] = a[5] * a[6] - a[3] * a[8];
    c.a[4] = a[0] * a[8] - a[2] * a[6];
    c.a[5] = a[2] * a[3] - a[0] * a[5];
    c.a[6] = a[3] * a[7] - a[4] * a[6];
    c.a[7] = a[1] * a[6] - a[0] * a[7];
    c.a[8] = a[0] * a[4] - a[1] * a[3];
    double determinant = a[0] * c.a[0] + a[1] * c.a[3] + a[2] * c.a[6];
#pragma unroll
    for (int i = 0; i < 9; i++) c.a[i] /= determinant;
    return c;
}

// The rotation of the polar decomposition, by Newton's iteration for the matrix sign (Higham 1986).
DEVICE Matrix3 rotation_of(Matrix3 m) {
    for (int step = 0; step < 12; step++) {
        Matrix3 inverted = inverse(m);
        double change = 0.0;
#pragma unroll
        for (int i = 0; i < 3; i++)
#pragma unroll
            for (int j = 0; j < 3; j++) {
                double next = 0.5 * (m.a[3 * i + j] + inverted.a[3 * j + i]);
                change = fmax(change, fabs(next - m.a[3 * i + j]));
                inverted.a[3 * j + i] = next;
            }
#pragma unroll
        for (int i = 0; i < 3; i++)
#pragma unroll
            for (int j = 0; j < 3; j++) m.a[3 * i + j] = inverted.a[3 * j + i];
        if (!(change > 1e-15)) break;
    }
    return m;
}

// Applies the k-th unit strain, in the order 11, 22, 33, 23, 13, 12.
DEVICE void strain(int k, const double *x, double *v) {
    v[0] = k == 0 ? x[0] : k == 4 ? x[2] : k == 5 ? x[1] : 0.0;
    v[1] = k == 1 ? x[1] : k == 3 ? x[2] : k == 5 ? x[0] : 0.0;
    v[2] = k == 2 ? x[2] : k == 3 ? x[1] : k == 4 ? x[0] : 0.0;
}

// Applies the w-th unit rotation.
DEVICE void spin(int w, const double *x, double *v) {
    v[0] = w == 1 ? x[2] : w == 2 ? -x[1] : 0.0;
    v[1] = w == 0 ? -x[2] : w == 2 ? x[0] : 0.0;
    v[2] = w == 0 ? x[1] : w == 1 ? -x[0] : 0.0;
}
