#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ipc.h>
#include <sys/shm.h>
#include <X11/Xutil.h>

#include "room.h"

enum { PIXEL = 4 };

static bool share(screen *seen) {
  int number = DefaultScreen(seen->display);
  seen->image = XShmCreateImage(seen->display, DefaultVisual(seen->display, number),
                                (unsigned)DefaultDepth(seen->display, number), ZPixmap, NULL, &seen->segment,
                                (unsigned)seen->width, (unsigned)seen->height);
  if (seen->image == NULL || seen->image->bits_per_pixel != 8 * PIXEL) {
    return false;
  }
  size_t bytes = (size_t)seen->image->bytes_per_line * (size_t)seen->height;
  seen->segment.shmid = shmget(IPC_PRIVATE, bytes, IPC_CREAT | 0600);
  seen->segment.shmaddr = seen->segment.shmid >= 0 ? shmat(seen->segment.shmid, NULL, 0) : (void *)-1;
  if (seen->segment.shmaddr == (void *)-1) {
    return false;
  }
  seen->image->data = seen->segment.shmaddr;
  bool attached = XShmAttach(seen->display, &seen->segment) != 0;
  XSync(seen->display, False);
  shmctl(seen->segment.shmid, IPC_RMID, NULL);
  seen->last = calloc(1, bytes);
  return attached && seen->last != NULL;
}

bool screen_open(screen *seen) {
  *seen = (screen){.display = XOpenDisplay(NULL)};
  if (seen->display == NULL) {
    fprintf(stderr, "room: there is no display %s\n", XDisplayName(NULL));
    return false;
  }
  seen->width = DisplayWidth(seen->display, DefaultScreen(seen->display));
  seen->height = DisplayHeight(seen->display, DefaultScreen(seen->display));
  if (!share(seen)) {
    fprintf(stderr, "room: the screen cannot be shared in memory with 32 bits a pixel\n");
    return false;
  }
  return true;
}

void screen_close(screen *seen) {
  if (seen->image != NULL && seen->image->data != NULL) {
    XShmDetach(seen->display, &seen->segment);
    shmdt(seen->segment.shmaddr);
    seen->image->data = NULL;
  }
  if (seen->image != NULL) {
    XDestroyImage(seen->image);
  }
  if (seen->display != NULL) {
    XCloseDisplay(seen->display);
  }
  free(seen->last);
}

bool screen_look(screen *seen) {
  int number = DefaultScreen(seen->display);
  size_t row = (size_t)seen->width * PIXEL;
  bool changed = false;
  XShmGetImage(seen->display, RootWindow(seen->display, number), seen->image, 0, 0, AllPlanes);
  for (int y = 0; y < seen->height; y++) {
    const char *from = seen->image->data + (size_t)y * (size_t)seen->image->bytes_per_line;
    if (memcmp(seen->last + (size_t)y * row, from, row) != 0) {
      memcpy(seen->last + (size_t)y * row, from, row);
      changed = true;
    }
  }
  return changed;
}
