/* The hard cases of the fixed-point contract as one list, for every backend: the core, the naive nets, the Verilated
 * accelerator, vector kernels. A case makes its input and states what must come out of it, whoever computes it; the
 * table in docs/fixed-point.md is this list.
 *
 *   HARD_NET      h->f and h->ray.dir through both nets of h->scene, in each of the four input modes
 *   HARD_RAY      h->ray through fx_render_ray
 *   HARD_REFUSED  `make` itself checks that the input is refused; nothing is run
 *
 * A runner calls hard_begin, then its backend, then `expect` with what that backend gave, then hard_end. */
#ifndef SF_TESTS_FX_HARD_CASES_H
#define SF_TESTS_FX_HARD_CASES_H
#include "tests/fx_hard_nets.h"
#include "tests/fx_hard_rays.h"

static const hard_case hard_cases[] = {
    {"tau_at_one_and_very_large", HARD_NET, 4, make_leak, expect_leak},
    {"theta_one_lsb", HARD_NET, 1, make_theta_one, expect_theta_one},
    {"silent_net", HARD_NET, 1, make_silent, expect_silent},
    {"every_neuron_fires", HARD_NET, 1, make_all_fire, expect_all_fire},
    {"current_at_threshold_and_one_off", HARD_NET, 9, make_at_threshold, expect_at_threshold},
    {"weights_and_features_at_the_rails", HARD_NET, 10, make_rails, expect_rails},
    {"alternating_features", HARD_NET, 1, make_alternating, expect_alternating},
    {"one_step_and_all_steps", HARD_NET, 2, make_steps, expect_steps},
    {"density_at_both_ends_of_exp", HARD_NET, 2, make_exp_ends, expect_exp_ends},
    {"nodecay_saturates_and_counts", HARD_NET, 2, make_nodecay, expect_nodecay},
    {"radix_spikes_are_digits", HARD_NET, SF_T_MAX, make_digits, expect_digits},
    {"denormals_in_a_checkpoint", HARD_NET, 2, make_denormals, expect_denormals},
    {"nan_and_inf_in_a_checkpoint", HARD_REFUSED, 3 * HARD_PARAMS, make_not_finite, NULL},
    {"optical_depth_zero_and_saturated", HARD_RAY, 4, make_depth, expect_depth},
    {"transmittance_underflow", HARD_RAY, 1, make_underflow, expect_underflow},
    {"empty_scene", HARD_RAY, 3, make_empty, expect_empty},
    {"opaque_scene", HARD_RAY, 3, make_opaque, expect_opaque},
    {"fog_is_the_product_of_its_parts", HARD_RAY, 3, make_fog, expect_fog},
    {"one_sample_and_sample_limit", HARD_RAY, 4, make_count, expect_count},
    {"positions_on_faces_and_ends", HARD_RAY, 27, make_face, expect_face},
    {"ray_parallel_to_an_axis", HARD_RAY, 6, make_parallel, expect_parallel},
    {"ray_through_edges", HARD_RAY, 12, make_edges, expect_edges},
    {"ray_through_corners", HARD_RAY, 8, make_corners, expect_corners},
    {"ray_from_inside", HARD_RAY, 6, make_inside, expect_inside},
    {"ray_missing_the_box", HARD_RAY, 5, make_missing, expect_missing},
    {"scene_scales_1e-6_and_1e6", HARD_RAY, 2, make_scale, expect_scale},
};
enum { HARD_CASES = COUNT(hard_cases) };

/* One Check case per hard case, so that a failure shows its name; `run` gets the index into hard_cases as _i. */
static inline void hard_add(const TTest *run)
{
  for (int i = 0; i < HARD_CASES; i++) tcase_add_loop_test(ck_new_case(hard_cases[i].name), run, i, i + 1);
}
#define HARD_TEST(name) REGISTERED_TEST(name, hard_add(name))
#endif
