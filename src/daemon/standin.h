/* The projector that the measuring thread's rig sees: it hands every pattern to the main thread and waits until it is
 * on the glass. */
#ifndef CLT_DAEMON_STANDIN_H
#define CLT_DAEMON_STANDIN_H

#include "daemon/letters.h"

/* A stand-in for the projector that info describes. present() gives CLT_TIMEOUT where the main thread does not answer,
 * CLT_CANCELLED where the mailbox of the answers was closed. */
clt_status standin_create(const daemon_boxes *boxes, const clt_projector_info *info, clt_projector **out,
                          clt_error *error);
/* Tells the main thread that measuring has ended: the drive is to be up again. */
void standin_release(const daemon_boxes *boxes);

#endif
