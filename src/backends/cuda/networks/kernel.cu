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

// The root of a positive number to rounding, and its inverse. Like the functions below it has no branch, so that the
// compiler can order the operations of several fibers.
DEVICE void root_of(double x, double &root, double &inverse) {
    double r = near_inverse_root(x);
    double e = fma(-x * r, r, 1.0);
    r = fma(r * e, fma(0.375, e, 0.5), r);
    root = x * r;
    root = fma(fma(-root, root, x), 0.5 * r, root);
    inverse = fma(r, fma(-root, r, 1.0), r);
}

// The quotient to rounding; `inverse` is that of `b`.
DEVICE double quotient(double a, double b, double inverse) {
    double q = a * inverse;
    return fma(fma(-q, b, a), inverse, q);
}

// exp(x) - 1, as `fiber::law::exp_m1` computes it.
DEVICE double growth_of(double x) {
    const double round = 6755399441055744.0;
    double bounded = x > 710.0 ? 710.0 : x;
    bounded = bounded < -50.0 ? -50.0 : bounded;
    double shifted = fma(bounded, 1.4426950408889634, round);
    double k = shifted - round;
    double half_power = from_bits((bits_of(shifted) << 52) + (1022ull << 52));
    double high = fma(-k, 6.931471803691238e-1, bounded), low = k * 1.9082149292705877e-10;
    double r = high - low, lost = (high - r) - low;
    double r2 = r * r, r4 = r2 * r2;
    double a = fma(fma(1.0 / 120.0, r, 1.0 / 24.0), r2, fma(1.0 / 6.0, r, 1.0 / 2.0));
    double b = fma(fma(1.0 / 362880.0, r, 1.0 / 40320.0), r2, fma(1.0 / 5040.0, r, 1.0 / 720.0));
    double c = fma(fma(1.0 / 6227020800.0, r, 1.0 / 479001600.0), r2, fma(1.0 / 39916800.0, r, 1.0 / 3628800.0));
    double d = 1.0 / 87178291200.0;
    double series = fma(fma(d, r4, c), r4 * r4, fma(b, r4, a));
    double beyond = fma(r2, series, lost);
    double scaled = fma(half_power, r, half_power - 0.5) + half_power * beyond;
    double near_zero = fabs(x) < 1e-17 ? x : r + beyond;
    return k == 0.0 ? near_zero : 2.0 * scaled;
}

DEVICE int kind_of(const double *law) {
#ifdef ONLY_LAW
    return ONLY_LAW;
#else
    return (int)law[0];
#endif
}

DEVICE bool buckles(const double *law, double stretch) {
#ifdef ONLY_LAW
    return false;
#else
    return law[4] != 0.0 && stretch < 1.0;
#endif
}

// The nominal stress of a fiber and its slope.
DEVICE void stress_of(const double *law, double stretch, double &stress, double &slope) {
    double modulus = law[1], b = law[2], curve = law[7];
    if (buckles(law, stretch)) {
        double r = law[5], w = law[6];
        double x = (1.0 - stretch) * law[9];
        double inside = x > 1.0 ? 1.0 : x, beyond = x - inside, square = inside * inside, lost = 1.0 - r;
        slope = modulus * (1.0 - lost * square * (3.0 - 2.0 * inside));
        stress = -modulus * w * (inside * (1.0 - lost * square * (1.0 - 0.5 * inside)) + r * beyond);
        return;
    }
    if (kind_of(law) == LAW_LINEAR) {
        double green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        stress = modulus * stretch * green;
        slope = modulus * (green + stretch * stretch);
    } else if (kind_of(law) == LAW_EXPONENTIAL) {
        double growth = growth_of(0.5 * b * (stretch - 1.0) * (stretch + 1.0));
        stress = curve * growth;
        slope = modulus * stretch * (growth + 1.0);
    } else {
        double nearest = stretch < 1.0 ? 1.0 : stretch;
        nearest = nearest > law[3] ? law[3] : nearest;
        double growth = growth_of(0.5 * b * (nearest - 1.0) * (nearest + 1.0));
        slope = curve * growth + modulus * nearest * nearest * (growth + 1.0);
        stress = curve * nearest * growth + slope * (stretch - nearest);
    }
}

// The integral of exp(B g) - 1 over the strain from `from` to `to`, by Gauss quadrature with eight points.
DEVICE double integral_of_growth(double b, double from, double to) {
    const double points[4] = {0.1834346424956498, 0.525532409916329, 0.7966664774136267, 0.9602898564975362};
    const double weights[4] = {0.362683783378362, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
    double sum = 0.0, middle = 0.5 * (from + to), half = 0.5 * (to - from);
#pragma unroll
    for (int k = 0; k < 4; k++) {
        double low = middle - half * points[k], high = middle + half * points[k];
        sum += weights[k] * (growth_of(0.5 * b * low * (low + 2.0)) + growth_of(0.5 * b * high * (high + 2.0)));
    }
    return half * sum;
}

// The energy of a fiber per reference volume.
DEVICE double energy_of(const double *law, double stretch) {
    double modulus = law[1], b = law[2], curve = law[7];
    if (buckles(law, stretch)) {
        double r = law[5], w = law[6];
        double x = (1.0 - stretch) * law[9];
        double inside = x > 1.0 ? 1.0 : x, y = x - inside, square = inside * inside, lost = 1.0 - r;
        return modulus * w * w *
               (square * (0.5 - lost * square * (0.25 - 0.1 * inside)) + y * (0.5 * (1.0 + r) + 0.5 * r * y));
    }
    if (kind_of(law) == LAW_LINEAR) {
        double green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        return 0.5 * modulus * green * green;
    }
    if (kind_of(law) == LAW_EXPONENTIAL) {
        // On each panel the exponent grows by at most about 1. Few fibers need more than one panel.
        double strain = stretch - 1.0;
        double panels = 1.0 + floor(fmin(0.4 * b * (fabs(strain * (stretch + 1.0)) + strain * strain), 4000.0));
        if (!(panels > 1.0)) return curve * integral_of_growth(b, 0.0, strain);
        double sum = 0.0, width = strain / panels;
        for (int panel = 0; panel < panels; panel++) sum += integral_of_growth(b, width * panel, width * (panel + 1));
        return curve * sum;
    }
    double nearest = stretch < 1.0 ? 1.0 : stretch;
    nearest = nearest > law[3] ? law[3] : nearest;
    double x = 0.5 * b * (nearest - 1.0) * (nearest + 1.0), growth = growth_of(x), beyond = stretch - nearest;
    double slope = curve * growth + modulus * nearest * nearest * (growth + 1.0);
    double stress = curve * nearest * growth;
    // exp(x) - 1 - x without cancellation.
    double series = 1.0;
#pragma unroll
    for (int k = 16; k >= 3; k--) series = 1.0 + series * (x * (1.0 / k));
    double remainder = fabs(x) > 0.5 ? growth - x : 0.5 * x * x * series;
    return curve / b * remainder + beyond * (stress + 0.5 * beyond * slope);
}

// The arrays of one lane, and its target.
struct Lane {
    double *trial, *direction, *stiffness, *edges, *diagonal, *lower, *modes;
    Matrix3 target;
};

// Copies `COUNT` numbers that start at entry `at` of a lane's array.
template <int COUNT> DEVICE void load(const double *RESTRICT from, u32 at, double *to) {
    const double *entry = from + (u64)at * LANES;
#pragma unroll
    for (int k = 0; k < COUNT; k++) to[k] = entry[k * LANES];
}

template <int COUNT> DEVICE void store(const double *from, double *RESTRICT to, u32 at) {
    double *entry = to + (u64)at * LANES;
#pragma unroll
    for (int k = 0; k < COUNT; k++) entry[k * LANES] = from[k];
}

// The position of a node.
DEVICE void position_of(const Uniform &u, const Lane &lane, u32 node, double *x) {
    if (node < u.interior)
        load<3>(lane.trial, 3 * node, x);
    else
        multiply(lane.target.a, u.boundary + 3 * (node - u.interior), x);
}

// A fiber as seen from a node.
struct Fiber {
    double n[3];  // direction to the other node
    double force, geometric, material;
    double ratio; // nominal stress over modulus, by absolute value
};

DEVICE double square_of_length(const double *d) {
    // Not fused, like the reference lengths of the host, so that the stretch at rest is exactly 1.
    return add(add(multiply(d[0], d[0]), multiply(d[1], d[1])), multiply(d[2], d[2]));
}

DEVICE Fiber fiber_between(const Uniform &u, u32 number, const double *near, const double *far) {
    const double *sizes = u.fiber_sizes + FIBER_LEN * number;
    const double *law = u.laws + LAW_LEN * u.fiber_laws[number];
    double d[3] = {far[0] - near[0], far[1] - near[1], far[2] - near[2]};
    double length, inverse_length, stress, slope;
    root_of(square_of_length(d), length, inverse_length);
    stress_of(law, quotient(length, sizes[0], sizes[1]), stress, slope);
    Fiber fiber;
    fiber.force = stress * sizes[2];
    fiber.geometric = fiber.force * inverse_length;
    fiber.material = slope * sizes[3] - fiber.geometric;
    fiber.ratio = fabs(stress) * law[8];
#pragma unroll
    for (int i = 0; i < 3; i++) fiber.n[i] = d[i] * inverse_length;
    return fiber;
}

// The fiber of an incident, as seen from its node at `x`.
DEVICE Fiber fiber_of(const Uniform &u, const Lane &lane, const u32 *incident, double *x) {
    double far[3];
    position_of(u, lane, incident[NEAR], x);
    position_of(u, lane, incident[FAR], far);
    return fiber_between(u, incident[FIBER], x, far);
}

// The number of the incident `k`, or of the last one.
DEVICE const u32 *incident_at(const Uniform &u, u32 k, u32 end) {
    return u.incidents + INCIDENT_LEN * (k < end ? k : end - 1);
}

// The stiffness of a fiber: xx, yx, yy, zx, zy, zz.
DEVICE void block_of(const Fiber &fiber, double *block) {
    const double *n = fiber.n;
    double x = fiber.material * n[0], y = fiber.material * n[1], z = fiber.material * n[2];
    block[0] = x * n[0] + fiber.geometric;
    block[1] = x * n[1];
    block[2] = y * n[1] + fiber.geometric;
    block[3] = x * n[2];
    block[4] = y * n[2];
    block[5] = z * n[2] + fiber.geometric;
}

struct Forces {
    double residual, scale, largest;
};

// Computes the forces of all nodes and the stiffness; the residual is in `direction`.
DEVICE Forces evaluate(const Uniform &u, const Lane &lane) {
    Forces forces = {0.0, 0.0, 0.0};
    double sum[3] = {0.0, 0.0, 0.0}, stiffness[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (u32 k = 0; k < u.inner_ends; k += AT_ONCE) {
        Fiber fibers[AT_ONCE];
        double x[3];
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) fibers[j] = fiber_of(u, lane, incident_at(u, k + j, u.inner_ends), x);
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) {
            if (k + j >= u.inner_ends) break;
            const u32 *incident = incident_at(u, k + j, u.inner_ends);
            const Fiber &fiber = fibers[j];
            double block[6];
            // A NaN counts as the largest.
            if (!(fiber.ratio <= forces.largest)) forces.largest = fiber.ratio;
            block_of(fiber, block);
#pragma unroll
            for (int i = 0; i < 3; i++) sum[i] -= fiber.force * fiber.n[i];
#pragma unroll
            for (int i = 0; i < 6; i++) stiffness[i] += block[i];
            u32 pair = incident[PAIR];
            if (pair != NONE) {
                if (!incident[IS_FIRST]) {
                    double before[6];
                    load<6>(lane.edges, 6 * pair, before);
#pragma unroll
                    for (int i = 0; i < 6; i++) block[i] += before[i];
                }
                store<6>(block, lane.edges, 6 * pair);
            }
            if (!incident[IS_LAST]) continue;
            forces.residual += sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
            store<3>(sum, lane.direction, 3 * incident[NEAR]);
            store<6>(stiffness, lane.stiffness, 6 * incident[NEAR]);
#pragma unroll
            for (int i = 0; i < 3; i++) sum[i] = 0.0;
#pragma unroll
            for (int i = 0; i < 6; i++) stiffness[i] = 0.0;
        }
    }
    forces.scale = forces.residual;
    for (u32 k = u.inner_ends; k < u.ends; k += AT_ONCE) {
        Fiber fibers[AT_ONCE];
        double x[3];
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) fibers[j] = fiber_of(u, lane, incident_at(u, k + j, u.ends), x);
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) {
            if (k + j >= u.ends) break;
            const Fiber &fiber = fibers[j];
            if (!(fiber.ratio <= forces.largest)) forces.largest = fiber.ratio;
#pragma unroll
            for (int i = 0; i < 3; i++) sum[i] -= fiber.force * fiber.n[i];
            if (!incident_at(u, k + j, u.ends)[IS_LAST]) continue;
            forces.scale += sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
#pragma unroll
            for (int i = 0; i < 3; i++) sum[i] = 0.0;
        }
    }
    forces.residual = sqrt(forces.residual);
    forces.scale = sqrt(forces.scale);
    return forces;
}

struct Pivots {
    double smallest, largest;
    bool positive;
};

DEVICE double pivot_root(Pivots &pivots, double pivot) {
    if (!(pivot > 0.0) || !isfinite(pivot)) pivots.positive = false;
    pivots.smallest = fmin(pivots.smallest, pivot);
    pivots.largest = fmax(pivots.largest, pivot);
    return 1.0 / sqrt(pivot);
}

// Replaces a diagonal block by the inverse of its Cholesky factor: xx, yx, yy, zx, zy, zz.
DEVICE void invert(Pivots &pivots, double *d) {
    double i00 = pivot_root(pivots, d[0]);
    double l10 = d[1] * i00, l20 = d[3] * i00;
    double i11 = pivot_root(pivots, d[2] - l10 * l10);
    double l21 = (d[4] - l20 * l10) * i11;
    double i22 = pivot_root(pivots, d[5] - l20 * l20 - l21 * l21);
    double i10 = -l10 * i00 * i11, i21 = -l21 * i11 * i22;
    d[3] = -(l20 * i00 + l21 * i10) * i22;
    d[0] = i00, d[1] = i10, d[2] = i11, d[4] = i21, d[5] = i22;
}

// sum -= a b^T
DEVICE void subtract_product(double *sum, const double *a, const double *b) {
#pragma unroll
    for (int p = 0; p < 3; p++)
#pragma unroll
        for (int q = 0; q < 3; q++)
            sum[3 * p + q] -= a[3 * p] * b[3 * q] + a[3 * p + 1] * b[3 * q + 1] + a[3 * p + 2] * b[3 * q + 2];
}

// The lower triangle of sum -= b b^T: xx, yx, yy, zx, zy, zz.
DEVICE void subtract_square(double *sum, const double *b) {
#pragma unroll
    for (int s = 0; s < 3; s++) {
        sum[0] -= b[s] * b[s];
        sum[1] -= b[3 + s] * b[s];
        sum[2] -= b[3 + s] * b[3 + s];
        sum[3] -= b[6 + s] * b[s];
        sum[4] -= b[6 + s] * b[3 + s];
        sum[5] -= b[6 + s] * b[6 + s];
    }
}

// y -= b x
DEVICE void subtract_image(double *y, const double *b, const double *x) {
#pragma unroll
    for (int p = 0; p < 3; p++) y[p] -= b[3 * p] * x[0] + b[3 * p + 1] * x[1] + b[3 * p + 2] * x[2];
}

// y -= b^T x
DEVICE void subtract_transposed_image(double *y, const double *b, const double *x) {
#pragma unroll
    for (int q = 0; q < 3; q++) y[q] -= b[q] * x[0] + b[3 + q] * x[1] + b[6 + q] * x[2];
}

// Multiplies the rows of a block by the transpose of an inverse.
DEVICE void scale_rows(double *block, const double *i) {
#pragma unroll
    for (int p = 0; p < 3; p++) {
        double x = block[3 * p], y = block[3 * p + 1], z = block[3 * p + 2];
        block[3 * p] = x * i[0];
        block[3 * p + 1] = x * i[1] + y * i[2];
        block[3 * p + 2] = x * i[3] + y * i[4] + z * i[5];
    }
}

DEVICE void multiply_inverse(const double *i, double *s) {
    s[2] = i[3] * s[0] + i[4] * s[1] + i[5] * s[2];
    s[1] = i[1] * s[0] + i[2] * s[1];
    s[0] = i[0] * s[0];
}

DEVICE void multiply_transposed_inverse(const double *i, double *s) {
    s[0] = i[0] * s[0] + i[1] * s[1] + i[3] * s[2];
    s[1] = i[2] * s[1] + i[4] * s[2];
    s[2] = i[5] * s[2];
}

// The place of the block of row p and column q of a tile, p > q.
DEVICE constexpr int inner(int p, int q) { return p * (p - 1) / 2 + q; }

// Starts a block from the stiffness.
DEVICE void start_block(const Lane &lane, u32 edge, double *sum) {
#pragma unroll
    for (int i = 0; i < 9; i++) sum[i] = 0.0;
    if (edge == NONE) return;
    double k[6];
    load<6>(lane.edges, 6 * edge, k);
    sum[0] = -k[0], sum[1] = -k[1], sum[2] = -k[3];
    sum[3] = -k[1], sum[4] = -k[2], sum[5] = -k[4];
    sum[6] = -k[3], sum[7] = -k[4], sum[8] = -k[5];
}

// Factors the stiffness of the last evaluation, K = L L^T, and solves L y = r for `direction` on the way. The diagonal
// blocks of the factor are replaced by their inverses.
DEVICE Pivots factor(const Uniform &u, const Lane &lane) {
    Pivots pivots = {1e308, 0.0, true};
    const u32 *op = u.factor;
    for (u32 tile = 0; tile < u.tiles; tile++) {
        u32 first = op[0], count = op[1];
        const u32 *within = op + 2;
        op += 2 + 2 * INNER;
        // The blocks of the tile on and below the diagonal.
        double d[COLUMNS][6], low[INNER + 1][9], y[COLUMNS][3];
#pragma unroll
        for (int q = 0; q < COLUMNS; q++) {
            // Columns that the tile does not have are a copy of the first one, which nothing reads.
            u32 node = (u32)q < count ? first + q : first;
            load<6>(lane.stiffness, 6 * node, d[q]);
            load<3>(lane.direction, 3 * node, y[q]);
#pragma unroll
            for (int p = q + 1; p < COLUMNS; p++) start_block(lane, within[2 * inner(p, q) + 1], low[inner(p, q)]);
        }
        for (u32 updates = *op++; updates > 0; updates--) {
            double before[3], b[COLUMNS][9];
            load<3>(lane.direction, 3 * op[0], before);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++) load<9>(lane.lower, 9 * op[1 + q], b[q]);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++) {
                subtract_square(d[q], b[q]);
                subtract_image(y[q], b[q], before);
#pragma unroll
                for (int p = q + 1; p < COLUMNS; p++) subtract_product(low[inner(p, q)], b[p], b[q]);
            }
            op += 1 + COLUMNS;
        }
#pragma unroll
        for (int q = 0; q < COLUMNS; q++) {
            if ((u32)q >= count) continue;
#pragma unroll
            for (int s = 0; s < q; s++) {
                subtract_square(d[q], low[inner(q, s)]);
                subtract_image(y[q], low[inner(q, s)], y[s]);
            }
            invert(pivots, d[q]);
            multiply_inverse(d[q], y[q]);
            store<6>(d[q], lane.diagonal, 6 * (first + q));
            store<3>(y[q], lane.direction, 3 * (first + q));
#pragma unroll
            for (int p = q + 1; p < COLUMNS; p++) {
                double *block = low[inner(p, q)];
#pragma unroll
                for (int s = 0; s < q; s++) subtract_product(block, low[inner(p, s)], low[inner(q, s)]);
                scale_rows(block, d[q]);
                u32 number = within[2 * inner(p, q)];
                if (number != NONE) store<9>(block, lane.lower, 9 * number);
            }
        }
        // The blocks below the tile.
        for (u32 groups = *op++; groups > 0; groups--) {
            double sums[ROWS][COLUMNS][9];
            const u32 *destination = op;
#pragma unroll
            for (int r = 0; r < ROWS; r++)
#pragma unroll
                for (int q = 0; q < COLUMNS; q++)
                    start_block(lane, destination[2 * (COLUMNS * r + q) + 1], sums[r][q]);
            op += 2 * COLUMNS * ROWS;
            for (u32 updates = *op++; updates > 0; updates--) {
                double b[COLUMNS][9], a[ROWS][9];
#pragma unroll
                for (int q = 0; q < COLUMNS; q++) load<9>(lane.lower, 9 * op[q], b[q]);
#pragma unroll
                for (int r = 0; r < ROWS; r++) load<9>(lane.lower, 9 * op[COLUMNS + r], a[r]);
#pragma unroll
                for (int r = 0; r < ROWS; r++)
#pragma unroll
                    for (int q = 0; q < COLUMNS; q++) subtract_product(sums[r][q], a[r], b[q]);
                op += COLUMNS + ROWS;
            }
            // The tile is read again, because its blocks would take the registers of the sums.
#pragma unroll
            for (int q = 0; q < COLUMNS; q++) {
                if ((u32)q >= count) continue;
                double i[6];
                load<6>(lane.diagonal, 6 * (first + q), i);
#pragma unroll
                for (int s = 0; s < q; s++) {
                    double b[9];
                    u32 number = within[2 * inner(q, s)];
                    load<9>(lane.lower, 9 * (number == NONE ? u.blocks : number), b);
#pragma unroll
                    for (int r = 0; r < ROWS; r++) subtract_product(sums[r][q], sums[r][s], b);
                }
#pragma unroll
                for (int r = 0; r < ROWS; r++) {
                    scale_rows(sums[r][q], i);
                    u32 number = destination[2 * (COLUMNS * r + q)];
                    if (number != NONE) store<9>(sums[r][q], lane.lower, 9 * number);
                }
            }
        }
    }
    return pivots;
}

// Solves L y = b for `COUNT` right-hand sides of three numbers a node, in place.
template <int COUNT> DEVICE void solve_forward(const Uniform &u, const Lane &lane, double *values) {
    const u32 *op = u.forward;
    for (u32 tile = 0; tile < u.tiles; tile++) {
        u32 first = op[0], count = op[1];
        const u32 *within = op + 2;
        op += 2 + INNER;
        double sums[COLUMNS][3 * COUNT];
#pragma unroll
        for (int q = 0; q < COLUMNS; q++)
            load<3 * COUNT>(values, 3 * COUNT * ((u32)q < count ? first + q : first), sums[q]);
        for (u32 updates = *op++; updates > 0; updates--) {
            double y[3 * COUNT], b[COLUMNS][9];
            load<3 * COUNT>(values, 3 * COUNT * op[0], y);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++) load<9>(lane.lower, 9 * op[1 + q], b[q]);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++)
#pragma unroll
                for (int c = 0; c < COUNT; c++) subtract_image(sums[q] + 3 * c, b[q], y + 3 * c);
            op += 1 + COLUMNS;
        }
#pragma unroll
        for (int q = 0; q < COLUMNS; q++) {
            if ((u32)q >= count) continue;
            double i[6];
#pragma unroll
            for (int s = 0; s < q; s++) {
                double b[9];
                load<9>(lane.lower, 9 * within[inner(q, s)], b);
#pragma unroll
                for (int c = 0; c < COUNT; c++) subtract_image(sums[q] + 3 * c, b, sums[s] + 3 * c);
            }
            load<6>(lane.diagonal, 6 * (first + q), i);
#pragma unroll
            for (int c = 0; c < COUNT; c++) multiply_inverse(i, sums[q] + 3 * c);
            store<3 * COUNT>(sums[q], values, 3 * COUNT * (first + q));
        }
    }
}

// Solves L^T x = y for `COUNT` right-hand sides of three numbers a node, in place.
template <int COUNT> DEVICE void solve_backward(const Uniform &u, const Lane &lane, double *values) {
    const u32 *op = u.backward;
    for (u32 tile = 0; tile < u.tiles; tile++) {
        u32 first = op[0], count = op[1];
        const u32 *within = op + 2;
        op += 2 + INNER;
        double sums[COLUMNS][3 * COUNT];
#pragma unroll
        for (int q = 0; q < COLUMNS; q++)
            load<3 * COUNT>(values, 3 * COUNT * ((u32)q < count ? first + q : first), sums[q]);
        for (u32 updates = *op++; updates > 0; updates--) {
            double x[3 * COUNT], b[COLUMNS][9];
            load<3 * COUNT>(values, 3 * COUNT * op[0], x);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++) load<9>(lane.lower, 9 * op[1 + q], b[q]);
#pragma unroll
            for (int q = 0; q < COLUMNS; q++)
#pragma unroll
                for (int c = 0; c < COUNT; c++) subtract_transposed_image(sums[q] + 3 * c, b[q], x + 3 * c);
            op += 1 + COLUMNS;
        }
#pragma unroll
        for (int q = COLUMNS - 1; q >= 0; q--) {
            if ((u32)q >= count) continue;
            double i[6];
#pragma unroll
            for (int p = q + 1; p < COLUMNS; p++) {
                if ((u32)p >= count) continue;
                double b[9];
                load<9>(lane.lower, 9 * within[inner(p, q)], b);
#pragma unroll
                for (int c = 0; c < COUNT; c++) subtract_transposed_image(sums[q] + 3 * c, b, sums[p] + 3 * c);
            }
            load<6>(lane.diagonal, 6 * (first + q), i);
#pragma unroll
            for (int c = 0; c < COUNT; c++) multiply_transposed_inverse(i, sums[q] + 3 * c);
            store<3 * COUNT>(sums[q], values, 3 * COUNT * (first + q));
        }
    }
}

// Multiplies the symmetric block of a fiber.
DEVICE void multiply_fiber(const double *block, const double *v, double *q) {
    q[0] = block[0] * v[0] + block[1] * v[1] + block[3] * v[2];
    q[1] = block[1] * v[0] + block[2] * v[1] + block[4] * v[2];
    q[2] = block[3] * v[0] + block[4] * v[1] + block[5] * v[2];
}

// Computes the sensitivities of the interior nodes to the six strains into `modes`; requires the factor of the stiffness.
DEVICE void solve_modes(const Uniform &u, const Lane &lane) {
    double loads[3 * MODES];
#pragma unroll
    for (int i = 0; i < 3 * MODES; i++) loads[i] = 0.0;
    for (u32 k = 0; k < u.inner_ends; k += AT_ONCE) {
        double blocks[AT_ONCE][6], d[AT_ONCE][3];
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) {
            const u32 *incident = incident_at(u, k + j, u.inner_ends);
            double x[3], far[3];
            position_of(u, lane, incident[NEAR], x);
            position_of(u, lane, incident[FAR], far);
            block_of(fiber_between(u, incident[FIBER], x, far), blocks[j]);
#pragma unroll
            for (int i = 0; i < 3; i++) d[j][i] = x[i] - far[i];
        }
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) {
            if (k + j >= u.inner_ends) break;
#pragma unroll
            for (int mode = 0; mode < MODES; mode++) {
                double v[3], q[3];
                strain(mode, d[j], v);
                multiply_fiber(blocks[j], v, q);
                loads[3 * mode] += q[0], loads[3 * mode + 1] += q[1], loads[3 * mode + 2] += q[2];
            }
            const u32 *incident = incident_at(u, k + j, u.inner_ends);
            if (!incident[IS_LAST]) continue;
            store<3 * MODES>(loads, lane.modes, 3 * MODES * incident[NEAR]);
#pragma unroll
            for (int i = 0; i < 3 * MODES; i++) loads[i] = 0.0;
        }
    }
    solve_forward<MODES>(u, lane, lane.modes);
    solve_backward<MODES>(u, lane, lane.modes);
    for (u32 node = 0; node < u.interior; node++) {
        double x[3], v[3 * MODES];
        position_of(u, lane, node, x);
        load<3 * MODES>(lane.modes, 3 * MODES * node, v);
#pragma unroll
        for (int mode = 0; mode < MODES; mode++) {
            double affine[3];
            strain(mode, x, affine);
#pragma unroll
            for (int i = 0; i < 3; i++) v[3 * mode + i] = affine[i] - v[3 * mode + i];
        }
        store<3 * MODES>(v, lane.modes, 3 * MODES * node);
    }
}

// The sensitivities of a node to the six strains.
DEVICE void modes_of(const Uniform &u, const Lane &lane, u32 node, const double *x, double *v) {
    if (node < u.interior) {
        load<3 * MODES>(lane.modes, 3 * MODES * node, v);
    } else {
#pragma unroll
        for (int mode = 0; mode < MODES; mode++) strain(mode, x, v + 3 * mode);
    }
}

// The place of a product of two strains among those of `products`, k <= l.
DEVICE constexpr int of_strains(int k, int l) { return l * (l + 1) / 2 + k; }
#define STRAIN_PRODUCTS (MODES * (MODES + 1) / 2)

// Writes the products of the force sensitivities with the sensitivities of the six strains and three rotations; returns
// the norm of the force sensitivities at interior nodes over that at all nodes. Those of strains with strains are
// symmetric like the stiffness. They are computed once, because the registers for all of them leave too few for loads
// that wait for memory at the same time.
DEVICE double products(const Uniform &u, const Lane &lane, double *result) {
    double strains[STRAIN_PRODUCTS], spins[3][MODES], all = 0.0, interior = 0.0;
#pragma unroll
    for (int k = 0; k < STRAIN_PRODUCTS; k++) strains[k] = 0.0;
#pragma unroll
    for (int w = 0; w < 3; w++)
#pragma unroll
        for (int l = 0; l < MODES; l++) spins[w][l] = 0.0;
    // The sum over the fibers of K (v - w) is their stiffness times v minus the sum of K w: v takes no registers while the
    // fibers are visited.
    double q[3 * MODES], stiffness[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
#pragma unroll
    for (int i = 0; i < 3 * MODES; i++) q[i] = 0.0;
    for (u32 k = 0; k < u.ends; k++) {
        const u32 *incident = u.incidents + INCIDENT_LEN * k;
        u32 node = incident[NEAR];
        double x[3], v[3 * MODES];
        {
            double far[3], w[3 * MODES], block[6];
            position_of(u, lane, incident[FAR], far);
            modes_of(u, lane, incident[FAR], far, w);
            position_of(u, lane, node, x);
            block_of(fiber_between(u, incident[FIBER], x, far), block);
#pragma unroll
            for (int i = 0; i < 6; i++) stiffness[i] += block[i];
#pragma unroll
            for (int mode = 0; mode < MODES; mode++) {
                double p[3];
                multiply_fiber(block, w + 3 * mode, p);
                q[3 * mode] -= p[0], q[3 * mode + 1] -= p[1], q[3 * mode + 2] -= p[2];
            }
        }
        if (!incident[IS_LAST]) continue;
        modes_of(u, lane, node, x, v);
#pragma unroll
        for (int mode = 0; mode < MODES; mode++) {
            double p[3];
            multiply_fiber(stiffness, v + 3 * mode, p);
            q[3 * mode] += p[0], q[3 * mode + 1] += p[1], q[3 * mode + 2] += p[2];
        }
        double square = 0.0;
#pragma unroll
        for (int i = 0; i < 3 * MODES; i++) square += q[i] * q[i];
        all += square;
        if (node < u.interior) interior += square;
#pragma unroll
        for (int l = 0; l < MODES; l++) {
#pragma unroll
            for (int k = 0; k <= l; k++)
                strains[of_strains(k, l)] += v[3 * k] * q[3 * l] + v[3 * k + 1] * q[3 * l + 1] + v[3 * k + 2] * q[3 * l + 2];
#pragma unroll
            for (int w = 0; w < 3; w++) {
                double turned[3];
                spin(w, x, turned);
                spins[w][l] += turned[0] * q[3 * l] + turned[1] * q[3 * l + 1] + turned[2] * q[3 * l + 2];
            }
        }
#pragma unroll
        for (int i = 0; i < 3 * MODES; i++) q[i] = 0.0;
#pragma unroll
        for (int i = 0; i < 6; i++) stiffness[i] = 0.0;
    }
#pragma unroll
    for (int l = 0; l < MODES; l++) {
#pragma unroll
        for (int k = 0; k < MODES; k++)
            result[(FORM + MODES * k + l) * LANES] = strains[k < l ? of_strains(k, l) : of_strains(l, k)];
#pragma unroll
        for (int w = 0; w < 3; w++) result[(FORM + MODES * (MODES + w) + l) * LANES] = spins[w][l];
    }
    return all > 0.0 ? sqrt(interior / all) : 0.0;
}

// The stress without its scale: the sum over boundary nodes of force times reference position.
DEVICE void write_stress(const Uniform &u, const Lane &lane, double *result) {
    double stress[9];
#pragma unroll
    for (int i = 0; i < 9; i++) stress[i] = 0.0;
    for (u32 k = u.inner_ends; k < u.ends; k += AT_ONCE) {
        Fiber fibers[AT_ONCE];
        double x[3];
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) fibers[j] = fiber_of(u, lane, incident_at(u, k + j, u.ends), x);
#pragma unroll
        for (u32 j = 0; j < AT_ONCE; j++) {
            if (k + j >= u.ends) break;
            const double *rest = u.boundary + 3 * (incident_at(u, k + j, u.ends)[NEAR] - u.interior);
#pragma unroll
            for (int p = 0; p < 3; p++)
#pragma unroll
                for (int q = 0; q < 3; q++) stress[3 * p + q] -= fibers[j].force * fibers[j].n[p] * rest[q];
        }
    }
#pragma unroll
    for (int i = 0; i < 9; i++) result[(STRESS + i) * LANES] = stress[i];
}

// The energy of all fibers.
DEVICE double energy(const Uniform &u, const Lane &lane) {
    double sum = 0.0;
    for (u32 fiber = 0; fiber < u.fibers; fiber++) {
        double a[3], b[3], length, inverse;
        position_of(u, lane, u.fiber_ends[2 * fiber], a);
        position_of(u, lane, u.fiber_ends[2 * fiber + 1], b);
        double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        const double *sizes = u.fiber_sizes + FIBER_LEN * fiber;
        root_of(square_of_length(d), length, inverse);
        sum += sizes[4] * energy_of(u.laws + LAW_LEN * u.fiber_laws[fiber], quotient(length, sizes[0], sizes[1]));
    }
    return sum;
}

DEVICE double distance(const Uniform &u, const Lane &lane, const double *reached) {
    double sum = 0.0;
    for (u32 i = 0; i < 3 * u.interior; i++) {
        double d = lane.trial[(u64)i * LANES] - reached[(u64)i * LANES];
        sum += d * d;
    }
    return sqrt(sum);
}

// Moves the interior by the affine increment from the state to the target, plus the first-order prediction if the state
// has sensitivities.
DEVICE void set_start(const Uniform &u, const Lane &lane, u64 network) {
    u64 tile = network / LANES, place = network % LANES;
    Matrix3 from;
    load<9>(u.gradients + tile * 9 * LANES + place, 0, from.a);
    const double *state = u.positions + tile * 3 * u.interior * LANES + place;
    bool same = true;
#pragma unroll
    for (int i = 0; i < 9; i++) same = same && from.a[i] == lane.target.a[i];
    Matrix3 increment = same ? Matrix3{{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}} : product(lane.target, inverse(from));
    bool predicts = !same && u.reached == 0 && u.sensitivities != 0 && u.has_sensitivities[tile * LANES + place] != 0.0;
    Matrix3 rotation = increment;
    double e[MODES] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    if (predicts) {
        rotation = rotation_of(increment);
        Matrix3 turned_back;
#pragma unroll
        for (int i = 0; i < 3; i++)
#pragma unroll
            for (int j = 0; j < 3; j++) turned_back.a[3 * i + j] = rotation.a[3 * j + i];
        Matrix3 stretch = product(turned_back, increment);
        e[0] = stretch.a[0] - 1.0, e[1] = stretch.a[4] - 1.0, e[2] = stretch.a[8] - 1.0;
        e[3] = stretch.a[5], e[4] = stretch.a[2], e[5] = stretch.a[1];
    }
    const float *sensitivities = u.sensitivities + tile * 18 * u.interior * LANES + place;
    for (u32 node = 0; node < u.interior; node++) {
        double x[3], moved[3];
        load<3>(state, 3 * node, x);
        if (same) {
            store<3>(x, lane.trial, 3 * node);
            continue;
        }
        multiply(increment.a, x, moved);
        if (predicts) {
            double correction[3] = {0.0, 0.0, 0.0}, turned[3];
#pragma unroll
            for (int k = 0; k < MODES; k++)
#pragma unroll
                for (int i = 0; i < 3; i++)
                    correction[i] += e[k] * (double)sensitivities[(u64)(18 * node + 3 * k + i) * LANES];
            multiply(rotation.a, correction, turned);
            moved[0] += turned[0], moved[1] += turned[1], moved[2] += turned[2];
        }
        store<3>(moved, lane.trial, 3 * node);
    }
}

// Replaces the state by the equilibrium, with its sensitivities minus those of the affine motion.
DEVICE void write_state(const Uniform &u, const Lane &lane, u64 network) {
    u64 tile = network / LANES, place = network % LANES;
    store<9>(lane.target.a, u.gradients + tile * 9 * LANES + place, 0);
    double *state = u.positions + tile * 3 * u.interior * LANES + place;
    bool keeps = u.sensitivities != 0 && u.wants_tangent != 0;
    float *sensitivities = u.sensitivities + tile * 18 * u.interior * LANES + place;
    for (u32 node = 0; node < u.interior; node++) {
        double x[3], v[3 * MODES];
        load<3>(lane.trial, 3 * node, x);
        store<3>(x, state, 3 * node);
        if (!keeps) continue;
        load<3 * MODES>(lane.modes, 3 * MODES * node, v);
#pragma unroll
        for (int k = 0; k < MODES; k++) {
            double affine[3];
            strain(k, x, affine);
#pragma unroll
            for (int i = 0; i < 3; i++)
                sensitivities[(u64)(18 * node + 3 * k + i) * LANES] = (float)(v[3 * k + i] - affine[i]);
        }
    }
    if (u.has_sensitivities != 0) u.has_sensitivities[tile * LANES + place] = keeps ? 1.0 : 0.0;
}

// The counts of one solution.
struct Course {
    u32 status, iterations, backtracks;
    double pivot_ratio;
    Forces forces;
};

// Newton's method with the nonmonotone line search of `las::newton`, from the positions in `trial`.
DEVICE Course newton(const Uniform &u, const Lane &lane, const double *reached) {
    Course course = {NOT_FINITE, 0, 0, 1.0, evaluate(u, lane)};
    double recent[MEMORY];
    double apart = reached == 0 ? 0.0 : distance(u, lane, reached);
    if (reached != 0 && apart <= 1e-10) {
        course.status = CONTINUES;
        return course;
    }
    bool running = isfinite(course.forces.residual) && isfinite(course.forces.scale);
    while (running) {
        Forces &forces = course.forces;
        double limit = fmax(u.tolerance * forces.scale, u.floor);
        bool converged = reached == 0 && forces.residual <= limit;
        if (!converged && course.iterations == u.max_iterations) {
            course.status = reached == 0 ? TOO_MANY_ITERATIONS : INCONCLUSIVE;
            break;
        }
        if (converged && !(forces.largest < u.excessive_force)) {
            course.status = EXCESSIVE_FORCE;
            break;
        }
        // At an equilibrium, the factor shows that it is stable, and serves the tangent.
        double residual = forces.residual;
        Pivots pivots = factor(u, lane);
        course.pivot_ratio = pivots.smallest / pivots.largest;
        if (!pivots.positive || !(u.interior == 0 || course.pivot_ratio >= SINGULAR)) {
            course.status = INDEFINITE;
            break;
        }
        if (converged) {
            course.status = CONVERGED;
            break;
        }
        solve_backward<1>(u, lane, lane.direction);
        double largest = residual;
        if (reached == 0) {
            u32 held = course.iterations < u.memory - 1 ? course.iterations : u.memory - 1;
            for (u32 k = 0; k < held; k++) largest = fmax(largest, recent[k]);
            if (u.memory > 1) recent[course.iterations % (u.memory - 1)] = residual;
        }
        course.iterations++;
        // The residual overwrites the direction: a copy of the iterate is not needed, because `trial` is restored from
        // the direction kept in `modes`.
        for (u32 i = 0; i < 3 * u.interior; i++) lane.modes[(u64)i * LANES] = lane.direction[(u64)i * LANES];
        double at = 0.0, step = 1.0;
        running = false;
        course.status = LINE_SEARCH;
        for (u32 backtrack = 0; backtrack <= u.max_backtracks; backtrack++) {
            double move = at - step;
            for (u32 i = 0; i < 3 * u.interior; i++)
                lane.trial[(u64)i * LANES] += move * lane.modes[(u64)i * LANES];
            at = step;
            Forces trial = evaluate(u, lane);
            bool finite = isfinite(trial.residual) && isfinite(trial.scale);
            double allowed = fmax((1.0 - u.sufficient_decrease * step) * largest, reached == 0 ? limit : 0.0);
            if (finite && (trial.residual <= allowed || u.max_backtracks == 0)) {
                course.forces = trial;
                running = true;
                break;
            }
            if (reached != 0) {
                course.status = INCONCLUSIVE;
                break;
            }
            if (backtrack == u.max_backtracks) break;
            double before = residual * residual, after = trial.residual * trial.residual;
            double cut = finite ? fmin(fmax(before * step / (after - before + 2.0 * before * step), 0.1), 0.5) : 0.5;
            step *= cut;
            course.backtracks++;
        }
        if (running && reached != 0) {
            double now = distance(u, lane, reached);
            if (!isfinite(now)) {
                course.status = INCONCLUSIVE;
                break;
            }
            if (now <= fmax(0.1 * apart, 1e-10)) {
                course.status = CONTINUES;
                break;
            }
            apart = now;
        }
    }
    return course;
}

// Returns the arrays of the lane of a thread.
DEVICE Lane lane_of(const Uniform &u, u64 thread) {
    u64 tile = thread / LANES, place = thread % LANES;
    Lane lane;
    lane.trial = u.trial + tile * 3 * u.interior * LANES + place;
    lane.direction = u.direction + tile * 3 * u.interior * LANES + place;
    lane.stiffness = u.stiffness + tile * 6 * u.interior * LANES + place;
    lane.edges = u.edges + tile * 6 * u.pairs * LANES + place;
    lane.diagonal = u.diagonal + tile * 6 * u.interior * LANES + place;
    lane.lower = u.lower + tile * 9 * (u.blocks + 1) * LANES + place;
    lane.modes = u.modes + tile * 18 * u.interior * LANES + place;
    return lane;
}

// Finds the equilibrium of network `first + THREAD`, and the factor of its stiffness.
KERNEL(equilibrate) {
    u64 network = u.first + THREAD;
    if (network >= u.networks) return;
    u64 tile = network / LANES, place = network % LANES;
    Lane lane = lane_of(u, THREAD);
    load<9>(u.targets + tile * 9 * LANES + place, 0, lane.target.a);
    set_start(u, lane, network);
    const double *reached = u.reached == 0 ? 0 : u.reached + tile * 3 * u.interior * LANES + place;
    Course course = newton(u, lane, reached);
    double *result = u.results + tile * RESULT_LEN * LANES + place;
    result[STATUS * LANES] = course.status;
    result[ITERATIONS * LANES] = course.iterations;
    result[BACKTRACKS * LANES] = course.backtracks;
    result[RESIDUAL * LANES] = course.forces.residual;
    result[SCALE * LANES] = course.forces.scale;
    result[PIVOT_RATIO * LANES] = course.pivot_ratio;
}

// Computes stress, energy and tangent of the equilibria of the last `equilibrate`, and stores them as states.
KERNEL(condense) {
    u64 network = u.first + THREAD;
    if (network >= u.networks) return;
    u64 tile = network / LANES, place = network % LANES;
    double *result = u.results + tile * RESULT_LEN * LANES + place;
    if (result[STATUS * LANES] != CONVERGED) return;
    Lane lane = lane_of(u, THREAD);
    load<9>(u.targets + tile * 9 * LANES + place, 0, lane.target.a);
    double imbalance = 0.0;
    if (u.wants_tangent) {
        solve_modes(u, lane);
        imbalance = products(u, lane, result);
    }
    write_stress(u, lane, result);
    result[ENERGY * LANES] = energy(u, lane);
    result[IMBALANCE * LANES] = imbalance;
    if (imbalance <= ACCURATE)
        write_state(u, lane, network);
    else
        result[STATUS * LANES] = INACCURATE_TANGENT;
}

// Copies `count` numbers of a node in the caller's numbering between an array by networks and one by tiles.
template <typename T> DEVICE void copy_in(const Uniform &u, const T *from, T *to, u32 count, u64 network) {
    from += network * count * u.interior;
    to += (network / LANES) * count * u.interior * LANES + network % LANES;
    for (u32 node = 0; node < u.interior; node++)
        for (u32 k = 0; k < count; k++) to[(u64)(count * node + k) * LANES] = from[(u64)count * u.order[node] + k];
}

template <typename T> DEVICE void copy_out(const Uniform &u, const T *from, T *to, u32 count, u64 network) {
    from += (network / LANES) * count * u.interior * LANES + network % LANES;
    to += network * count * u.interior;
    for (u32 node = 0; node < u.interior; node++)
        for (u32 k = 0; k < count; k++) to[(u64)count * u.order[node] + k] = from[(u64)(count * node + k) * LANES];
}

// Copies the targets of the caller, and the equilibria to which Newton must lead.
KERNEL(take_targets) {
    u64 network = THREAD, tile = network / LANES, place = network % LANES;
    if (network >= u.networks) return;
    for (int i = 0; i < 9; i++) u.targets[(tile * 9 + i) * LANES + place] = u.caller_targets[network * 9 + i];
    if (u.reached != 0) copy_in(u, u.caller_reached, u.reached, 3, network);
}

// Copies the states of the caller.
KERNEL(take_states) {
    u64 network = THREAD, tile = network / LANES, place = network % LANES;
    if (network >= u.networks) return;
    for (int i = 0; i < 9; i++) u.gradients[(tile * 9 + i) * LANES + place] = u.caller_gradients[network * 9 + i];
    copy_in(u, u.caller_positions, u.positions, 3, network);
    if (u.sensitivities != 0) copy_in(u, u.caller_sensitivities, u.sensitivities, 18, network);
}

// Copies the states to the caller.
KERNEL(give_states) {
    u64 network = THREAD, tile = network / LANES, place = network % LANES;
    if (network >= u.networks) return;
    for (int i = 0; i < 9; i++) u.caller_gradients[network * 9 + i] = u.gradients[(tile * 9 + i) * LANES + place];
    copy_out(u, u.positions, u.caller_positions, 3, network);
    if (u.sensitivities != 0) copy_out(u, u.sensitivities, u.caller_sensitivities, 18, network);
}

// Copies the results to the caller.
KERNEL(give_results) {
    u64 network = THREAD, tile = network / LANES, place = network % LANES;
    if (network >= u.networks) return;
    for (int i = 0; i < RESULT_LEN; i++)
        u.caller_results[network * RESULT_LEN + i] = u.results[(tile * RESULT_LEN + i) * LANES + place];
}
