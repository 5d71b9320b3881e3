/* SHA-256 (FIPS 180-4): names the scene a picture or a report was made from. hex: lower case, as sha256sum prints it.
 */
#ifndef SF_BASE_SHA256_H
#define SF_BASE_SHA256_H
#include "base/status.h"
#include <stddef.h>

/* Of a file. SF_E_IO. */
sf_status sf_sha256_file(const char *path, char hex[65]);
void sf_sha256(const void *data, size_t size, char hex[65]);
#endif
