#include "daemon/peer.h"

#include <grp.h>
#include <sys/socket.h>
#include <unistd.h>

enum { GROUPS_READ = 256 };

static bool has_group(int socket, gid_t group) {
  gid_t groups[GROUPS_READ];
  socklen_t size = sizeof groups;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0) {
    return false;
  }
  for (size_t i = 0; i < size / sizeof groups[0]; i++) {
    if (groups[i] == group) {
      return true;
    }
  }
  return false;
}

bool peer_read(int socket, gid_t group, peer *out) {
  struct ucred credentials;
  socklen_t size = sizeof credentials;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) {
    return false;
  }
  bool in_group = group != (gid_t)-1 && (credentials.gid == group || has_group(socket, group));
  *out = (peer){credentials.pid, credentials.uid, credentials.gid, in_group};
  return true;
}

bool peer_allowed(const peer *who) {
  return peer_may_name_paths(who) || who->in_group;
}

bool peer_may_name_paths(const peer *who) {
  return who->uid == 0 || who->uid == geteuid();
}

gid_t peer_group(const char *name) {
  const struct group *entry = getgrnam(name);
  return entry != NULL ? entry->gr_gid : (gid_t)-1;
}
