// The part of cuSPARSE that multiplies a matrix in compressed rows, in double precision and with 32-bit indices.

#include <cstddef>
#include <cstdint>
#include <functional>

namespace {

enum Status { SUCCESS = 0, INVALID_VALUE = 3, NOT_SUPPORTED = 10 };
constexpr int F64 = 1, INDEX_32 = 2;

struct Handle {
    void *stream = nullptr;
};

struct Matrix {
    int64_t rows, cols;
    const int32_t *offsets, *columns;
    const double *values;
};

struct Vector {
    int64_t size;
    double *values;
};

} // namespace

extern "C" {

void emulated_enqueue(void *stream, const std::function<void()> &work);

int cusparseCreate(void **handle) {
    *handle = new Handle;
    return SUCCESS;
}

int cusparseDestroy(void *handle) {
    delete static_cast<Handle *>(handle);
    return SUCCESS;
}

int cusparseSetStream(void *handle, void *stream) {
    static_cast<Handle *>(handle)->stream = stream;
    return SUCCESS;
}

int cusparseCreateCsr(void **matrix, int64_t rows, int64_t cols, int64_t, void *offsets, void *columns, void *values,
                      int of_offsets, int of_columns, int base, int of_values) {
    if (of_offsets != INDEX_32 || of_columns != INDEX_32 || base != 0 || of_values != F64) return NOT_SUPPORTED;
    *matrix = new Matrix{rows, cols, static_cast<int32_t *>(offsets), static_cast<int32_t *>(columns),
                         static_cast<double *>(values)};
    return SUCCESS;
}

int cusparseDestroySpMat(const void *matrix) {
    delete static_cast<const Matrix *>(matrix);
    return SUCCESS;
}

int cusparseCreateDnVec(void **vector, int64_t size, void *values, int type) {
    if (type != F64) return NOT_SUPPORTED;
    *vector = new Vector{size, static_cast<double *>(values)};
    return SUCCESS;
}

int cusparseDestroyDnVec(const void *vector) {
    delete static_cast<const Vector *>(vector);
    return SUCCESS;
}

int cusparseSpMV_bufferSize(void *, int, const void *, const void *, const void *, const void *, void *, int, int, size_t *bytes) {
    *bytes = 64;
    return SUCCESS;
}

int cusparseSpMV(void *handle, int operation, const void *alpha, const void *matrix, const void *x, const void *beta, void *y,
                 int type, int, void *buffer) {
    const Matrix a = *static_cast<const Matrix *>(matrix);
    const Vector from = *static_cast<const Vector *>(x), to = *static_cast<Vector *>(y);
    const double of_product = *static_cast<const double *>(alpha), of_sum = *static_cast<const double *>(beta);
    if (operation != 0 || type != F64) return NOT_SUPPORTED;
    if (from.size != a.cols || to.size != a.rows || !buffer) return INVALID_VALUE;
    emulated_enqueue(static_cast<Handle *>(handle)->stream, [=] {
        for (int64_t row = 0; row < a.rows; row++) {
            double sum = 0.0;
            for (int32_t k = a.offsets[row]; k < a.offsets[row + 1]; k++) sum += a.values[k] * from.values[a.columns[k]];
            to.values[row] = of_product * sum + (of_sum == 0.0 ? 0.0 : of_sum * to.values[row]);
        }
    });
    return SUCCESS;
}

} // extern "C"
