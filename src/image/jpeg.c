#include "image/codec.h"
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <jpeglib.h>
#include <jerror.h>

/* A progressive picture takes some ten; each goes through all of it, however few bytes the scan has. */
enum { SCANS_MAX = 200 };

/* Everything that lives across the longjmp sits here, in memory. `base` first: libjpeg hands back its address. */
typedef struct jpeg_job {
  struct jpeg_error_mgr base;
  jmp_buf escape;
  struct jpeg_decompress_struct codec;
  struct jpeg_progress_mgr progress;
  JSAMPLE *line;
  sf_image *image;
  const char *path;
  sf_status status;
  char message[JMSG_LENGTH_MAX];
} jpeg_job;

static void on_error(j_common_ptr codec)
{
  jpeg_job *job = (jpeg_job *)codec->err;
  codec->err->format_message(codec, job->message);
  longjmp(job->escape, 1);
}

/* libjpeg fills what is missing with grey and warns: here a damaged file is an error. */
static void on_message(j_common_ptr codec, int level)
{
  int code = codec->err->msg_code;
  bool harmless = code == JWRN_EXTRANEOUS_DATA || code == JWRN_JFIF_MAJOR || code == JWRN_ADOBE_XFORM;
  if (level < 0 && !harmless) on_error(codec);
}

static void on_progress(j_common_ptr codec)
{
  jpeg_job *job = (jpeg_job *)codec->err;
  if (job->codec.input_scan_number <= SCANS_MAX) return;
  snprintf(job->message, sizeof job->message, "more than %d scans", SCANS_MAX);
  longjmp(job->escape, 1);
}

/* What would cost memory or time out of all proportion to the file, or is not read at all. */
static sf_status check_kind(const struct jpeg_decompress_struct *codec, const char *path, size_t size)
{
  if (codec->jpeg_color_space == JCS_CMYK || codec->jpeg_color_space == JCS_YCCK)
    return sf_fail(SF_E_UNSUPPORTED, "%s: JPEG: CMYK colours", path);
  if (codec->arith_code) return sf_fail(SF_E_UNSUPPORTED, "%s: JPEG: arithmetic coding", path);
  /* Huffman codes spend at least one bit on each block of 8 x 8 pixels. */
  if ((uint64_t)codec->image_width * codec->image_height / 512 > size)
    return sf_fail(SF_E_FORMAT, "%s: JPEG: %zu bytes cannot hold %u x %u pixels", path, size, codec->image_width,
                   codec->image_height);
  return sf_ok();
}

static void widen_line(const JSAMPLE *from, uint16_t *to, int width)
{
  for (int x = 0; x < width; x++) {
    for (int c = 0; c < 3; c++) to[4 * x + c] = (uint16_t)(from[3 * x + c] * 257);
    to[4 * x + 3] = 65535;
  }
}

static void decode(jpeg_job *job, const unsigned char *bytes, size_t size)
{
  struct jpeg_decompress_struct *codec = &job->codec;
  jpeg_create_decompress(codec);
  jpeg_mem_src(codec, bytes, size);
  jpeg_read_header(codec, TRUE);
  job->status = check_kind(codec, job->path, size);
  if (job->status.code != SF_OK) return;
  codec->progress = &job->progress;
  codec->out_color_space = JCS_RGB;
  job->status = sf_image_alloc(job->image, job->path, codec->image_width, codec->image_height);
  if (job->status.code != SF_OK) return;
  jpeg_start_decompress(codec);
  size_t width = codec->output_width;
  job->line = malloc(width * 3);
  if (!job->line) {
    job->status = sf_fail(SF_E_MEMORY, "%s: no memory", job->path);
    return;
  }
  while (codec->output_scanline < codec->output_height) {
    size_t y = codec->output_scanline;
    jpeg_read_scanlines(codec, &job->line, 1);
    widen_line(job->line, job->image->rgba + y * width * 4, (int)width);
  }
  jpeg_finish_decompress(codec);
}

sf_status sf_jpeg_load(sf_image *image, const char *path, const unsigned char *bytes, size_t size)
{
  jpeg_job job;
  memset(&job, 0, sizeof job);
  job.image = image, job.path = path, job.status = sf_ok();
  job.codec.err = jpeg_std_error(&job.base);
  job.base.error_exit = on_error;
  job.base.emit_message = on_message;
  job.progress.progress_monitor = on_progress;
  if (setjmp(job.escape))
    job.status = sf_fail(SF_E_FORMAT, "%s: JPEG: %s", path, job.message);
  else
    decode(&job, bytes, size);
  jpeg_destroy_decompress(&job.codec);
  free(job.line);
  if (job.status.code != SF_OK) sf_image_free(image);
  return job.status;
}
