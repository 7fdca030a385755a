// The kernels.

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
