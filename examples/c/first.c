/* Displacements of a chain of three springs of stiffness 1: the left end is fixed, a force of 1 pulls the right end. */
#include <stdio.h>
#include <stdlib.h>

#include "las.h"

/* Ends the program with the message of the library if a call failed. */
static void check(int code) {
    if (code == LAS_OK) return;
    fprintf(stderr, "error %d: %s\n", code, las_message());
    exit(EXIT_FAILURE);
}

int main(void) {
    /* Spring e joins the unknowns ends[2 e] and ends[2 e + 1]; -1 is the fixed end. */
    const int element_start[4] = {0, 2, 4, 6}, ends[6] = {-1, 0, 0, 1, 1, 2};
    const double stiffness[4] = {1, -1, -1, 1}, force = 1;
    const int all[3] = {0, 1, 2}, last = 2;
    double values[3];
    struct las_params params;
    struct las_sparse *las;
    struct las_pattern *pattern;
    struct las_mat_sparse *k;
    struct las_vec_sparse *f, *u;
    struct las_solver_sparse *solver;

    /* Assemble K and f. */
    check(las_create_sparse(&las));
    check(las_create_pattern_of_elements(3, 3, element_start, ends, &pattern));
    check(las_create_mat_sparse(las, pattern, &k));
    check(las_create_vec_sparse(las, 3, &f));
    check(las_create_vec_sparse(las, 3, &u));
    for (int e = 0; e < 3; ++e) check(las_add_mat_sparse(k, 2, &ends[2 * e], 2, &ends[2 * e], stiffness));
    check(las_finish_mat_sparse(k));
    check(las_add_vec_sparse(f, 1, &last, &force));
    check(las_finish_vec_sparse(f));

    /* Solve K u = f. */
    check(las_default_params(&params));
    check(las_create_solver_sparse(las, pattern, &params, &solver));
    check(las_factor_sparse(solver, k));
    check(las_solve_sparse(solver, f, u, NULL, NULL));
    check(las_get_vec_sparse(u, 3, all, values));
    printf("u = %.1f %.1f %.1f\n", values[0], values[1], values[2]);

    las_destroy_solver_sparse(solver);
    las_destroy_vec_sparse(u);
    las_destroy_vec_sparse(f);
    las_destroy_mat_sparse(k);
    las_destroy_pattern(pattern);
    las_destroy_sparse(las);
    return EXIT_SUCCESS;
}
