/* A tradeoff as the answer of `counterlight tradeoff --json` and of the control socket. */
#ifndef CLT_TRADEOFF_JSON_H
#define CLT_TRADEOFF_JSON_H

#include <jansson.h>

#include "counterlight/tradeoff.h"

/* {grid, sentence, chosen, front, limit, noise, solves, gaps}; a new reference, NULL where memory is short. */
json_t *clt_tradeoff_json(const clt_tradeoff *tradeoff);

#endif
