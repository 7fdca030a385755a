// Newton's method.

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
