// Equilibria of many fiber networks with the same connectivity, one thread a network.
//
// A thread is a lane: the 32 lanes of a warp execute the same operations on 32 networks, in the order of the schedule
// that the host made from the elimination order. Arrays of numbers per network are stored in tiles of 32 networks,
// entry after entry, so that a warp reads and writes 256 contiguous bytes.
//
// The file is CUDA C++ for NVRTC; with EMULATE defined, it is C++ for the processor, where tests run the same source.
//
// Interior nodes are numbered by their place in the elimination order; boundary nodes follow them.

#ifdef EMULATE
#include <cmath>
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
using std::expm1, std::fabs, std::floor, std::fmax, std::fmin, std::isfinite, std::sqrt;
#else
#define KERNEL(name) extern "C" __global__ void __launch_bounds__(BLOCK_THREADS) name(const Uniform u)
#define DEVICE __device__ __forceinline__
#define RESTRICT __restrict__
#define THREAD ((u64)blockIdx.x * blockDim.x + threadIdx.x)
#endif

// Lanes of a tile.
#define LANES 32
// Rows of a column of the factor whose sums are in registers at the same time; the schedule is made for this number.
#ifndef ROWS
#define ROWS 4
#endif
// The index that denotes no block, no edge.
#define NONE 0xffffffffu
// Residual norms that the line search compares with, at most.
#define MEMORY 8
// Strain modes.
#define MODES 6

typedef unsigned u32;
typedef unsigned long long u64;

// What is the same for all networks of a batch. The layout is that of `Uniform` in `layout.rs`.
struct Uniform {
    // The network.
    const u32 *fiber_ends;        // two nodes a fiber
    const double *fiber_sizes;    // four numbers a fiber: length, area, area over length, volume
    const u32 *fiber_laws;        // a law a fiber
    const double *laws;           // LAW_LEN numbers a law
    const double *boundary;       // three reference coordinates a boundary node
    const u32 *incident_start;    // by node, one entry more than there are nodes
    const u32 *incident;          // twice the fiber, plus one for its second end
    const u32 *edge_start;        // by pair of coupled interior nodes
    const u32 *edge_fibers;
    // The schedule.
    const u32 *factor;            // the operations of a factorization
    const u32 *row_start;         // by node: the blocks of its row of the factor, left of the diagonal
    const u32 *row_blocks;        // a block and its column
    const u32 *column_start;      // by node: the blocks of its column, below the diagonal
    const u32 *column_rows;       // the row of each block
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
    double *fiber_blocks;         // 6 a fiber: its stiffness
    double *fiber_pulls;          // 3 a fiber: its force on its second end
    double *diagonal;             // 6 interior: inverses of the diagonal blocks of the factor
    double *lower;                // 9 a block: the factor below the diagonal
    double *modes;                // 18 interior
    // Counts and parameters.
    u64 networks;
    u64 first;                    // the first network of this launch
    u32 interior, nodes, fibers, blocks;
    u32 max_iterations, max_backtracks, memory, wants_tangent;
    double tolerance, floor, sufficient_decrease, excessive_force;
};

// Numbers of a law: kind, modulus, nonlinearity, transition; then whether it buckles, residual stiffness, strain, modulus.
#define LAW_LEN 8
#define LAW_LINEAR 0
#define LAW_EXPONENTIAL 1
#define LAW_EXPONENTIAL_STRETCH 2

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

// The nominal stress of a fiber and its slope.
DEVICE void stress_of(const double *law, double stretch, double &stress, double &slope) {
    double modulus = law[1], b = law[2];
    if (law[4] != 0.0 && stretch < 1.0) {
        double r = law[5], w = law[6], e = law[7];
        double x = (1.0 - stretch) / w;
        double inside = x > 1.0 ? 1.0 : x, beyond = x - inside, square = inside * inside, lost = 1.0 - r;
        slope = e * (1.0 - lost * square * (3.0 - 2.0 * inside));
        stress = -e * w * (inside * (1.0 - lost * square * (1.0 - 0.5 * inside)) + r * beyond);
        return;
    }
    if (law[0] == LAW_LINEAR) {
        double green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        stress = modulus * stretch * green;
        slope = modulus * (green + stretch * stretch);
    } else if (law[0] == LAW_EXPONENTIAL) {
        double growth = expm1(0.5 * b * (stretch - 1.0) * (stretch + 1.0));
        stress = modulus / b * growth;
        slope = modulus * stretch * (growth + 1.0);
    } else {
        double nearest = stretch < 1.0 ? 1.0 : stretch;
        nearest = nearest > law[3] ? law[3] : nearest;
        double growth = expm1(0.5 * b * (nearest - 1.0) * (nearest + 1.0));
        slope = modulus * (growth / b + nearest * nearest * (growth + 1.0));
        stress = modulus / b * nearest * growth + slope * (stretch - nearest);
    }
}

// The energy of a fiber per reference volume.
DEVICE double energy_of(const double *law, double stretch) {
    double modulus = law[1], b = law[2];
    if (law[4] != 0.0 && stretch < 1.0) {
        double r = law[5], w = law[6], e = law[7];
        double x = (1.0 - stretch) / w;
        double inside = x > 1.0 ? 1.0 : x, y = x - inside, square = inside * inside, lost = 1.0 - r;
        return e * w * w * (square * (0.5 - lost * square * (0.25 - 0.1 * inside)) + y * (0.5 * (1.0 + r) + 0.5 * r * y));
    }
    if (law[0] == LAW_LINEAR) {
        double green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        return 0.5 * modulus * green * green;
    }
    if (law[0] == LAW_EXPONENTIAL) {
        // Gauss quadrature of the stress; on each panel the exponent grows by at most about 1.
        const double points[4] = {0.1834346424956498, 0.525532409916329, 0.7966664774136267, 0.9602898564975362};
        const double weights[4] = {0.362683783378362, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
        double strain = stretch - 1.0;
        double panels = 1.0 + floor(fmin(0.4 * b * (fabs(strain * (stretch + 1.0)) + strain * strain), 4000.0));
        double sum = 0.0, width = strain / panels;
        for (int panel = 0; panel < panels; panel++) {
            double middle = width * (panel + 0.5), half = 0.5 * width;
            for (int k = 0; k < 4; k++) {
                double low = middle - half * points[k], high = middle + half * points[k];
                sum += half * weights[k] * (expm1(0.5 * b * low * (low + 2.0)) + expm1(0.5 * b * high * (high + 2.0)));
            }
        }
        return modulus / b * sum;
    }
    double nearest = stretch < 1.0 ? 1.0 : stretch;
    nearest = nearest > law[3] ? law[3] : nearest;
    double x = 0.5 * b * (nearest - 1.0) * (nearest + 1.0), growth = expm1(x), beyond = stretch - nearest;
    double slope = modulus * (growth / b + nearest * nearest * (growth + 1.0));
    double stress = modulus / b * nearest * growth;
    // exp(x) - 1 - x without cancellation.
    double series = 1.0;
    for (int k = 16; k >= 3; k--) series = 1.0 + series * x / k;
    double remainder = fabs(x) > 0.5 ? growth - x : 0.5 * x * x * series;
    return modulus / (b * b) * remainder + beyond * (stress + 0.5 * beyond * slope);
}

// The arrays of one lane, and its target.
struct Lane {
    double *trial, *direction, *fiber_blocks, *fiber_pulls, *diagonal, *lower, *modes;
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

struct Forces {
    double residual, scale, largest;
};

// Computes forces and stiffness of all fibers, and the residual into `direction`.
DEVICE Forces evaluate(const Uniform &u, const Lane &lane) {
    Forces forces = {0.0, 0.0, 0.0};
    for (u32 fiber = 0; fiber < u.fibers; fiber++) {
        double a[3], b[3];
        position_of(u, lane, u.fiber_ends[2 * fiber], a);
        position_of(u, lane, u.fiber_ends[2 * fiber + 1], b);
        const double *sizes = u.fiber_sizes + 4 * fiber;
        const double *law = u.laws + LAW_LEN * u.fiber_laws[fiber];
        double n[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        double stretch = length / sizes[0], inverse_length = 1.0 / length, stress, slope;
        stress_of(law, stretch, stress, slope);
        double force = stress * sizes[1], geometric = force * inverse_length;
        double material = slope * sizes[2] - geometric;
        double ratio = fabs(stress / law[7]);
        // A NaN counts as the largest.
        if (!(ratio <= forces.largest)) forces.largest = ratio;
        n[0] *= inverse_length, n[1] *= inverse_length, n[2] *= inverse_length;
        double pull[3] = {force * n[0], force * n[1], force * n[2]};
        double block[6] = {material * n[0] * n[0] + geometric, material * n[0] * n[1], material * n[1] * n[1] + geometric,
                           material * n[0] * n[2], material * n[1] * n[2], material * n[2] * n[2] + geometric};
        store<6>(block, lane.fiber_blocks, 6 * fiber);
        store<3>(pull, lane.fiber_pulls, 3 * fiber);
    }
    for (u32 node = 0; node < u.nodes; node++) {
        double sum[3] = {0.0, 0.0, 0.0};
        for (u32 k = u.incident_start[node]; k < u.incident_start[node + 1]; k++) {
            u32 incident = u.incident[k];
            double pull[3], sign = incident & 1 ? 1.0 : -1.0;
            load<3>(lane.fiber_pulls, 3 * (incident >> 1), pull);
            sum[0] += sign * pull[0], sum[1] += sign * pull[1], sum[2] += sign * pull[2];
        }
        double square = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
        forces.scale += square;
        if (node < u.interior) {
            forces.residual += square;
            store<3>(sum, lane.direction, 3 * node);
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

// Factors the stiffness of the last evaluation, K = L L^T, and solves L y = r for `direction` on the way. The diagonal
// blocks of the factor are replaced by their inverses.
DEVICE Pivots factor(const Uniform &u, const Lane &lane) {
    Pivots pivots = {1e308, 0.0, true};
    const u32 *op = u.factor;
    for (u32 j = 0; j < u.interior; j++) {
        // The diagonal block: xx, yx, yy, zx, zy, zz.
        double d[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, y[3];
        for (u32 k = u.incident_start[j]; k < u.incident_start[j + 1]; k++) {
            double block[6];
            load<6>(lane.fiber_blocks, 6 * (u.incident[k] >> 1), block);
#pragma unroll
            for (int i = 0; i < 6; i++) d[i] += block[i];
        }
        load<3>(lane.direction, 3 * j, y);
        for (u32 k = u.row_start[j]; k < u.row_start[j + 1]; k++) {
            double b[9], before[3];
            load<9>(lane.lower, 9 * u.row_blocks[2 * k], b);
            load<3>(lane.direction, 3 * u.row_blocks[2 * k + 1], before);
#pragma unroll
            for (int s = 0; s < 3; s++) {
                d[0] -= b[s] * b[s];
                d[1] -= b[3 + s] * b[s];
                d[2] -= b[3 + s] * b[3 + s];
                d[3] -= b[6 + s] * b[s];
                d[4] -= b[6 + s] * b[3 + s];
                d[5] -= b[6 + s] * b[6 + s];
                y[0] -= b[s] * before[s];
                y[1] -= b[3 + s] * before[s];
                y[2] -= b[6 + s] * before[s];
            }
        }
        double i00 = pivot_root(pivots, d[0]);
        double l10 = d[1] * i00, l20 = d[3] * i00;
        double i11 = pivot_root(pivots, d[2] - l10 * l10);
        double l21 = (d[4] - l20 * l10) * i11;
        double i22 = pivot_root(pivots, d[5] - l20 * l20 - l21 * l21);
        double i10 = -l10 * i00 * i11, i21 = -l21 * i11 * i22;
        double i20 = -(l20 * i00 + l21 * i10) * i22;
        double inverted[6] = {i00, i10, i11, i20, i21, i22};
        double solved[3] = {i00 * y[0], i10 * y[0] + i11 * y[1], i20 * y[0] + i21 * y[1] + i22 * y[2]};
        store<6>(inverted, lane.diagonal, 6 * j);
        store<3>(solved, lane.direction, 3 * j);
        // The blocks below, ROWS at a time.
        for (u32 groups = *op++; groups > 0; groups--) {
            double sums[ROWS][9];
            const u32 *destination = op;
#pragma unroll
            for (int r = 0; r < ROWS; r++) {
#pragma unroll
                for (int i = 0; i < 9; i++) sums[r][i] = 0.0;
                u32 edge = destination[2 * r + 1];
                if (edge == NONE) continue;
                for (u32 k = u.edge_start[edge]; k < u.edge_start[edge + 1]; k++) {
                    double block[6];
                    load<6>(lane.fiber_blocks, 6 * u.edge_fibers[k], block);
                    sums[r][0] -= block[0], sums[r][1] -= block[1], sums[r][2] -= block[3];
                    sums[r][3] -= block[1], sums[r][4] -= block[2], sums[r][5] -= block[4];
                    sums[r][6] -= block[3], sums[r][7] -= block[4], sums[r][8] -= block[5];
                }
            }
            op += 2 * ROWS;
            for (u32 updates = *op++; updates > 0; updates--) {
                double b[9];
                load<9>(lane.lower, 9 * op[0], b);
#pragma unroll
                for (int r = 0; r < ROWS; r++) {
                    u32 number = op[1 + r];
                    if (number == NONE) continue;
                    double a[9];
                    load<9>(lane.lower, 9 * number, a);
#pragma unroll
                    for (int p = 0; p < 3; p++)
#pragma unroll
                        for (int q = 0; q < 3; q++)
                            sums[r][3 * p + q] -=
                                a[3 * p] * b[3 * q] + a[3 * p + 1] * b[3 * q + 1] + a[3 * p + 2] * b[3 * q + 2];
                }
                op += 1 + ROWS;
            }
#pragma unroll
            for (int r = 0; r < ROWS; r++) {
                if (destination[2 * r] == NONE) continue;
                double block[9];
#pragma unroll
                for (int p = 0; p < 3; p++) {
                    double x = sums[r][3 * p], y = sums[r][3 * p + 1], z = sums[r][3 * p + 2];
                    block[3 * p] = x * i00;
                    block[3 * p + 1] = x * i10 + y * i11;
                    block[3 * p + 2] = x * i20 + y * i21 + z * i22;
                }
                store<9>(block, lane.lower, 9 * destination[2 * r]);
            }
        }
    }
    return pivots;
}

// Solves L^T x = y for `COUNT` right-hand sides of three numbers a node, in place.
template <int COUNT> DEVICE void solve_backward(const Uniform &u, const Lane &lane, double *values) {
    for (u32 j = u.interior; j-- > 0;) {
        double sums[3 * COUNT], i[6];
        load<3 * COUNT>(values, 3 * COUNT * j, sums);
        for (u32 k = u.column_start[j]; k < u.column_start[j + 1]; k++) {
            double b[9], x[3 * COUNT];
            load<9>(lane.lower, 9 * k, b);
            load<3 * COUNT>(values, 3 * COUNT * u.column_rows[k], x);
#pragma unroll
            for (int c = 0; c < COUNT; c++)
#pragma unroll
                for (int q = 0; q < 3; q++)
                    sums[3 * c + q] -= b[q] * x[3 * c] + b[3 + q] * x[3 * c + 1] + b[6 + q] * x[3 * c + 2];
        }
        load<6>(lane.diagonal, 6 * j, i);
#pragma unroll
        for (int c = 0; c < COUNT; c++) {
            double *s = sums + 3 * c;
            s[0] = i[0] * s[0] + i[1] * s[1] + i[3] * s[2];
            s[1] = i[2] * s[1] + i[4] * s[2];
            s[2] = i[5] * s[2];
        }
        store<3 * COUNT>(sums, values, 3 * COUNT * j);
    }
}

// Solves L y = b for `COUNT` right-hand sides of three numbers a node, in place.
template <int COUNT> DEVICE void solve_forward(const Uniform &u, const Lane &lane, double *values) {
    for (u32 j = 0; j < u.interior; j++) {
        double sums[3 * COUNT], i[6];
        load<3 * COUNT>(values, 3 * COUNT * j, sums);
        for (u32 k = u.row_start[j]; k < u.row_start[j + 1]; k++) {
            double b[9], y[3 * COUNT];
            load<9>(lane.lower, 9 * u.row_blocks[2 * k], b);
            load<3 * COUNT>(values, 3 * COUNT * u.row_blocks[2 * k + 1], y);
#pragma unroll
            for (int c = 0; c < COUNT; c++)
#pragma unroll
                for (int p = 0; p < 3; p++)
                    sums[3 * c + p] -= b[3 * p] * y[3 * c] + b[3 * p + 1] * y[3 * c + 1] + b[3 * p + 2] * y[3 * c + 2];
        }
        load<6>(lane.diagonal, 6 * j, i);
#pragma unroll
        for (int c = 0; c < COUNT; c++) {
            double *s = sums + 3 * c;
            s[2] = i[3] * s[0] + i[4] * s[1] + i[5] * s[2];
            s[1] = i[1] * s[0] + i[2] * s[1];
            s[0] = i[0] * s[0];
        }
        store<3 * COUNT>(sums, values, 3 * COUNT * j);
    }
}

// Multiplies the symmetric block of a fiber.
DEVICE void multiply_fiber(const double *block, const double *v, double *q) {
    q[0] = block[0] * v[0] + block[1] * v[1] + block[3] * v[2];
    q[1] = block[1] * v[0] + block[2] * v[1] + block[4] * v[2];
    q[2] = block[3] * v[0] + block[4] * v[1] + block[5] * v[2];
}

// The node at the other end of a fiber.
DEVICE u32 other_end(const Uniform &u, u32 incident) {
    return u.fiber_ends[2 * (incident >> 1) + (1 - (incident & 1))];
}

// Computes the sensitivities of the interior nodes to the six strains into `modes`; requires the factor of the stiffness.
DEVICE void solve_modes(const Uniform &u, const Lane &lane) {
    for (u32 node = 0; node < u.interior; node++) {
        double x[3], loads[3 * MODES];
        position_of(u, lane, node, x);
#pragma unroll
        for (int i = 0; i < 3 * MODES; i++) loads[i] = 0.0;
        for (u32 k = u.incident_start[node]; k < u.incident_start[node + 1]; k++) {
            double far[3], block[6];
            position_of(u, lane, other_end(u, u.incident[k]), far);
            load<6>(lane.fiber_blocks, 6 * (u.incident[k] >> 1), block);
            double d[3] = {x[0] - far[0], x[1] - far[1], x[2] - far[2]};
#pragma unroll
            for (int mode = 0; mode < MODES; mode++) {
                double v[3], q[3];
                strain(mode, d, v);
                multiply_fiber(block, v, q);
                loads[3 * mode] += q[0], loads[3 * mode + 1] += q[1], loads[3 * mode + 2] += q[2];
            }
        }
        store<3 * MODES>(loads, lane.modes, 3 * MODES * node);
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

// Writes the products of the force sensitivities with the sensitivities of the six strains and three rotations; returns
// the norm of the force sensitivities at interior nodes over that at all nodes.
DEVICE double products(const Uniform &u, const Lane &lane, double *result) {
    double form[9][MODES], all = 0.0, interior = 0.0;
#pragma unroll
    for (int k = 0; k < 9; k++)
#pragma unroll
        for (int l = 0; l < MODES; l++) form[k][l] = 0.0;
    for (u32 node = 0; node < u.nodes; node++) {
        double x[3], v[3 * MODES], q[3 * MODES];
        position_of(u, lane, node, x);
        modes_of(u, lane, node, x, v);
#pragma unroll
        for (int i = 0; i < 3 * MODES; i++) q[i] = 0.0;
        for (u32 k = u.incident_start[node]; k < u.incident_start[node + 1]; k++) {
            double far[3] = {0.0, 0.0, 0.0}, w[3 * MODES], block[6];
            u32 other = other_end(u, u.incident[k]);
            if (other >= u.interior) position_of(u, lane, other, far);
            modes_of(u, lane, other, far, w);
            load<6>(lane.fiber_blocks, 6 * (u.incident[k] >> 1), block);
#pragma unroll
            for (int mode = 0; mode < MODES; mode++) {
                double d[3], p[3];
#pragma unroll
                for (int i = 0; i < 3; i++) d[i] = v[3 * mode + i] - w[3 * mode + i];
                multiply_fiber(block, d, p);
                q[3 * mode] += p[0], q[3 * mode + 1] += p[1], q[3 * mode + 2] += p[2];
            }
        }
        double square = 0.0;
#pragma unroll
        for (int i = 0; i < 3 * MODES; i++) square += q[i] * q[i];
        all += square;
        if (node < u.interior) interior += square;
#pragma unroll
        for (int l = 0; l < MODES; l++) {
#pragma unroll
            for (int k = 0; k < MODES; k++)
                form[k][l] += v[3 * k] * q[3 * l] + v[3 * k + 1] * q[3 * l + 1] + v[3 * k + 2] * q[3 * l + 2];
#pragma unroll
            for (int w = 0; w < 3; w++) {
                double turned[3];
                spin(w, x, turned);
                form[MODES + w][l] += turned[0] * q[3 * l] + turned[1] * q[3 * l + 1] + turned[2] * q[3 * l + 2];
            }
        }
    }
#pragma unroll
    for (int k = 0; k < 9; k++)
#pragma unroll
        for (int l = 0; l < MODES; l++) result[(FORM + MODES * k + l) * LANES] = form[k][l];
    return all > 0.0 ? sqrt(interior / all) : 0.0;
}

// The stress without its scale: the sum over boundary nodes of force times reference position.
DEVICE void write_stress(const Uniform &u, const Lane &lane, double *result) {
    double stress[9];
#pragma unroll
    for (int i = 0; i < 9; i++) stress[i] = 0.0;
    for (u32 node = u.interior; node < u.nodes; node++) {
        double sum[3] = {0.0, 0.0, 0.0};
        for (u32 k = u.incident_start[node]; k < u.incident_start[node + 1]; k++) {
            double pull[3], sign = u.incident[k] & 1 ? 1.0 : -1.0;
            load<3>(lane.fiber_pulls, 3 * (u.incident[k] >> 1), pull);
            sum[0] += sign * pull[0], sum[1] += sign * pull[1], sum[2] += sign * pull[2];
        }
        const double *rest = u.boundary + 3 * (node - u.interior);
#pragma unroll
        for (int i = 0; i < 3; i++)
#pragma unroll
            for (int j = 0; j < 3; j++) stress[3 * i + j] += sum[i] * rest[j];
    }
#pragma unroll
    for (int i = 0; i < 9; i++) result[(STRESS + i) * LANES] = stress[i];
}

// The energy of all fibers.
DEVICE double energy(const Uniform &u, const Lane &lane) {
    double sum = 0.0;
    for (u32 fiber = 0; fiber < u.fibers; fiber++) {
        double a[3], b[3];
        position_of(u, lane, u.fiber_ends[2 * fiber], a);
        position_of(u, lane, u.fiber_ends[2 * fiber + 1], b);
        double n[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        double stretch = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / u.fiber_sizes[4 * fiber];
        sum += u.fiber_sizes[4 * fiber + 3] * energy_of(u.laws + LAW_LEN * u.fiber_laws[fiber], stretch);
    }
    return sum;
}

DEVICE void advance(const Uniform &u, const Lane &lane, double a) {
    for (u32 i = 0; i < 3 * u.interior; i++) lane.trial[(u64)i * LANES] += a * lane.direction[(u64)i * LANES];
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
    lane.fiber_blocks = u.fiber_blocks + tile * 6 * u.fibers * LANES + place;
    lane.fiber_pulls = u.fiber_pulls + tile * 3 * u.fibers * LANES + place;
    lane.diagonal = u.diagonal + tile * 6 * u.interior * LANES + place;
    lane.lower = u.lower + tile * 9 * u.blocks * LANES + place;
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
