// The numbers of one network, its fibers, forces and stiffness.

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
