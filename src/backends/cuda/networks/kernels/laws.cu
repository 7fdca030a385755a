// Fiber laws, and the functions that they need.

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
