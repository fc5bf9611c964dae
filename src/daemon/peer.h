/* Who is at the other end of the control socket. */
#ifndef CLT_DAEMON_PEER_H
#define CLT_DAEMON_PEER_H

#include <stdbool.h>
#include <sys/types.h>

typedef struct peer {
  pid_t pid;
  uid_t uid;
  gid_t gid;
  bool in_group; /* the group that may use the socket is one of the peer's groups */
} peer;

/* Asks the kernel (SO_PEERCRED, SO_PEERGROUPS); group (gid_t)-1: none. False where it does not say. */
bool peer_read(int socket, gid_t group, peer *out);
/* May use the socket: root, the daemon's own user, and members of the group. */
bool peer_allowed(const peer *who);
/* May have the daemon open a path with the daemon's rights: root and the daemon's own user. Others pass a descriptor
 * that they opened themselves. */
bool peer_may_name_paths(const peer *who);
/* The group's number, or (gid_t)-1 where there is none of that name. */
gid_t peer_group(const char *name);

#endif
