/* For the tests of pictures: noise, and damaged files. */
#ifndef SF_TESTS_IMAGE_FIXTURE_H
#define SF_TESTS_IMAGE_FIXTURE_H
#include "folder_fixture.h"
#include "image/image.h"

static inline sf_image noise_image(int width, int height)
{
  sf_image image = {width, height, malloc((size_t)width * (size_t)height * 8)};
  for (int i = 0; i < width * height * 4; i++) image.rgba[i] = (uint16_t)(sf_random_u64(1, 0, (uint64_t)i) >> 48);
  return image;
}

static inline sf_status load_image(const char *path)
{
  sf_image image;
  sf_status s = sf_image_load(&image, path);
  if (s.code == SF_OK)
    sf_image_free(&image);
  else
    ck_assert_ptr_null(image.rgba);
  return s;
}

#endif
