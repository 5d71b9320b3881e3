#ifndef SF_TESTS_MUTATE_SAMPLE_MEAN_H
#define SF_TESTS_MUTATE_SAMPLE_MEAN_H
int sample_mean(const int *x, int n); /* rounded to 0; of none: 0 */
#endif
