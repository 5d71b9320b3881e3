#include "tools/train/keeper.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

const char *keeper_before(const train_arguments *a)
{
  static char path[4200];
  snprintf(path, sizeof path, "%s.before", a->output);
  return path;
}

static sf_status set_aside(const train_arguments *a, keeper *k)
{
  struct stat info;
  if (k->begun || a->resume || stat(a->output, &info) || !S_ISREG(info.st_mode)) return sf_ok();
  if (!access(keeper_before(a), F_OK))
    return sf_ok(); /* kept by a run that was interrupted: it may be a finished model */
  if (rename(a->output, keeper_before(a)))
    return sf_fail(SF_E_IO, "%s: what is there cannot be kept as %s: %s", a->output, keeper_before(a), strerror(errno));
  k->aside = true;
  return sf_ok();
}

static sf_status save(const sf_trainer *trainer, const train_arguments *a, bool with_state, keeper *k)
{
  SF_TRY(set_aside(a, k));
  const sf_status status = sf_trainer_save(trainer, a->output, with_state);
  k->begun |= !status.code;
  if (!k->begun && k->aside) k->aside = rename(keeper_before(a), a->output) != 0;
  return status;
}

static void warn_full(keeper *k, const sf_status *why)
{
  if (!k->told) fprintf(stderr, "sf_train: warning: %s: no checkpoint, the run goes on\n", why->message);
  k->told = true;
}

sf_status keeper_checkpoint(const sf_trainer *trainer, const train_arguments *a, bool now, sf_progress *progress,
                            keeper *k)
{
  if (sf_ranks_rank(a->train.ranks)) return sf_ok();
  const sf_status status = save(trainer, a, true, k);
  if (!status.code) k->good = true;
  if (now || status.code != SF_E_IO) return status;
  sf_progress_end(progress);
  warn_full(k, &status);
  return sf_ok();
}

sf_status keeper_learned(const sf_trainer *trainer, const train_arguments *a, keeper *k)
{
  if (sf_ranks_rank(a->train.ranks)) return sf_ok();
  const sf_status status = save(trainer, a, true, k);
  k->good = !status.code;
  if (status.code != SF_E_IO) return status;
  SF_TRY(save(trainer, a, false, k));
  k->finished = true;
  warn_full(k, &status);
  return sf_ok();
}

sf_status keeper_finish(const sf_trainer *trainer, const train_arguments *a, keeper *k)
{
  if (!k->finished) SF_TRY(save(trainer, a, false, k));
  if (k->aside) unlink(keeper_before(a));
  return sf_ok();
}
