/* One thread, without OpenMP's library: fuzzers run faster so, and the same input always takes the same path. */
#ifndef SF_TESTS_FUZZ_SINGLE_OMP_H
#define SF_TESTS_FUZZ_SINGLE_OMP_H
typedef int omp_lock_t;
#define omp_get_max_threads() 1
#define omp_get_num_procs() 1
#define omp_get_thread_num() 0
#define omp_set_num_threads(threads) ((void)(threads))
#define omp_init_lock(lock) ((void)(lock))
#define omp_set_lock(lock) ((void)(lock))
#define omp_unset_lock(lock) ((void)(lock))
#define omp_destroy_lock(lock) ((void)(lock))
#endif
