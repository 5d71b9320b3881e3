/* Errors are values. A function that can fail returns sf_status; the message says what went
 * wrong, where (file, byte offset, line, tensor) and what was expected. Only tools/ prints it. */
#ifndef SF_BASE_STATUS_H
#define SF_BASE_STATUS_H

typedef enum {
  SF_OK = 0,
  SF_E_IO,          /* the operating system refused: missing file, full disk, no permission */
  SF_E_FORMAT,      /* a file's contents are not what its format says */
  SF_E_RANGE,       /* a number is outside its stated range */
  SF_E_MEMORY,      /* an allocation failed or its size overflows */
  SF_E_UNSUPPORTED, /* well-formed, but beyond what this build or the hardware can represent */
  SF_E_USAGE,       /* command line: tools exit with status 2 */
  SF_E_DIFFERENCE,  /* a comparison that must be equal was not */
  SF_E_STOPPED      /* interrupted by the user after a clean shutdown */
} sf_code;

typedef struct sf_status {
  sf_code code;
  char message[400]; /* one line, no trailing newline; empty when code == SF_OK */
} sf_status;

sf_status sf_ok(void);

/* printf-style; the result is cut to fit. */
sf_status sf_fail(sf_code code, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Returns from the calling function when `call` failed. */
#define SF_TRY(call)                                                                                                   \
  do {                                                                                                                 \
    sf_status sf_try_status_ = (call);                                                                                 \
    if (sf_try_status_.code != SF_OK) return sf_try_status_;                                                           \
  } while (0)

#endif
