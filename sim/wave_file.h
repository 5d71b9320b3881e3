/* Checks waveform files (FST). Verilator does not report a full disk, and its reader crashes on such a file. */
#ifndef SF_SIM_WAVE_FILE_H
#define SF_SIM_WAVE_FILE_H
#include "base/status.h"

/* Call it when nothing writes the file any more. SF_E_IO with the cause if the file is missing or incomplete. */
sf_status sf_wave_file_check(const char *path);
/* Verilator's writer maps a file beside the waveform into memory. On a full disk it reads beyond what was written, and
 * the process gets SIGBUS. Under the guard that ends the program: exit status 1, the cause on stderr, the waveform's
 * files and `more` (NULL or two paths, each may be "") removed. wave NULL ends the guard. */
void sf_wave_file_guard(const char *wave, const char *const more[2]);
#endif
