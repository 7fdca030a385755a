// The Cholesky factorization.

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
