/* The clock of every measured time. */
#ifndef SF_BASE_CLOCK_H
#define SF_BASE_CLOCK_H

double sf_seconds(void); /* monotonic; of no particular beginning */
#endif
