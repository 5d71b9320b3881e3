/* NumPy's .npy files: the two-dimensional arrays of floats that data sets hold. */
#ifndef SF_SCENE_NPY_H
#define SF_SCENE_NPY_H
#include "base/status.h"

/* *value: [rows][columns], every one finite, malloc'ed. dtype <f8 or <f4 in C order; columns as stated, rows >= 1. */
sf_status sf_npy_load(const char *path, int columns, double **value, int *rows);
#endif
