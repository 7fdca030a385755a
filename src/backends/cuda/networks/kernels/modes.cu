// Stress, energy, and the sensitivities for the tangent.

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
