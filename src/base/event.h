/* The kinds of events and the paper's prices, from spikefield/event.def. */
#ifndef SF_BASE_EVENT_H
#define SF_BASE_EVENT_H
#include "spikefield/event.def"

typedef enum {
#define SF_EVENT_ID(id, name, title, unit, fj) SF_EVENT_##id,
  SF_EVENT_TABLE(SF_EVENT_ID) SF_EVENTS
#undef SF_EVENT_ID
} sf_event_id;

enum {
#define SF_EVENT_FJ(id, name, title, unit, fj) SF_##id##_FJ = fj,
  SF_EVENT_TABLE(SF_EVENT_FJ)
#undef SF_EVENT_FJ
};
#endif
