/* NumPy's .npy files: the two-dimensional arrays of floats that data sets hold. */
#ifndef SPIKEFIELD_SCENE_NPY_H
#define SPIKEFIELD_SCENE_NPY_H
#include "spikefield/status.h"

/* *value: [rows][columns], every one finite, malloc'ed. dtype <f8 or <f4 in C order; columns as stated, rows >= 1. */
sf_status sf_npy_load(const char *path, int columns, double **value, int *rows);
#endif
