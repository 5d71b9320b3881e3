/* The kinds of events, from spikefield/event.def. */
#ifndef SF_BASE_EVENT_H
#define SF_BASE_EVENT_H

typedef enum {
#define SF_EVENT(id, name, title) SF_EVENT_##id,
#include "spikefield/event.def"
  SF_EVENTS
} sf_event_id;
#endif
