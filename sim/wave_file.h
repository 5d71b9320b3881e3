/* Checks waveform files (FST). Verilator does not report a full disk, and its reader crashes on such a file. */
#ifndef SF_SIM_WAVE_FILE_H
#define SF_SIM_WAVE_FILE_H
#include "base/status.h"

/* Call it when nothing writes the file any more. SF_E_IO with the cause if the file is missing or incomplete. */
sf_status sf_wave_file_check(const char *path);
#endif
