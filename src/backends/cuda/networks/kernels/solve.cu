// The solution of triangular systems.

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
