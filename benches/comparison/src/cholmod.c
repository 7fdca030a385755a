/* CHOLMOD's supernodal Cholesky of a symmetric matrix given by the columns of its lower triangle. */
#include <cholmod.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    cholmod_common common;
    cholmod_sparse matrix;
    cholmod_factor *factor;
    cholmod_dense *solution, *y, *e;
} cholmod_solver;

/* Creates a solver and analyzes the pattern. The arrays must outlive the solver. `ordering` is CHOLMOD_AMD (2) or
 * CHOLMOD_METIS (3). */
cholmod_solver *cholmod_solver_new(int n, int *column_start, int *rows, double *values, int ordering) {
    cholmod_solver *b = calloc(1, sizeof(cholmod_solver));
    if (!b) return NULL;
    cholmod_start(&b->common);
    b->common.supernodal = CHOLMOD_SUPERNODAL;
    b->common.nmethods = 1;
    b->common.method[0].ordering = ordering;
    b->common.postorder = 1;
    b->common.print = 0;
    b->matrix = (cholmod_sparse){
        .nrow = n, .ncol = n, .nzmax = column_start[n], .p = column_start, .i = rows, .x = values, .stype = -1,
        .itype = CHOLMOD_INT, .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE, .sorted = 1, .packed = 1};
    b->factor = cholmod_analyze(&b->matrix, &b->common);
    return b->factor ? b : NULL;
}

/* Factors the present values; returns 0 if that succeeds. */
int cholmod_solver_factor(cholmod_solver *b) {
    return !cholmod_factorize(&b->matrix, b->factor, &b->common) || b->common.status != CHOLMOD_OK;
}

/* Solves for right-hand sides stored by columns; returns 0 if that succeeds. */
int cholmod_solver_solve(cholmod_solver *b, int columns, double *right, double *solution) {
    int n = (int)b->matrix.nrow;
    cholmod_dense dense = {.nrow = n, .ncol = columns, .nzmax = (size_t)n * columns, .d = n, .x = right,
                           .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
    if (!cholmod_solve2(CHOLMOD_A, b->factor, &dense, NULL, &b->solution, NULL, &b->y, &b->e, &b->common)) return 1;
    memcpy(solution, b->solution->x, (size_t)n * columns * sizeof(double));
    return 0;
}

double cholmod_solver_operations(cholmod_solver *b) { return b->common.fl; }

void cholmod_solver_free(cholmod_solver *b) {
    cholmod_free_dense(&b->solution, &b->common);
    cholmod_free_dense(&b->y, &b->common);
    cholmod_free_dense(&b->e, &b->common);
    cholmod_free_factor(&b->factor, &b->common);
    cholmod_finish(&b->common);
    free(b);
}
