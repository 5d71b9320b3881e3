/* Waveform files (FST) as Verilator leaves them: it says nothing where the disk was full, and its reader crashes there.
 */
#ifndef SF_SIM_WAVE_FILE_H
#define SF_SIM_WAVE_FILE_H
#include "base/status.h"

/* SF_E_IO with the cause where the file is not there, or is not whole. Once nothing writes it any more. */
sf_status sf_wave_file_check(const char *path);
#endif
