/* The one test of mean.c. It never asks for the mean of one number. */
#include "mean.h"

int main(void)
{
  const int x[3] = {2, 4, 9};
  return sample_mean(x, 3) == 5 && sample_mean(x, 2) == 3 && sample_mean(x, 0) == 0 ? 0 : 1;
}
