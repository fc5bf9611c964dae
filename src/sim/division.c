#include "sim/division.h"

/* Elements that squares of a side give; most + 1 where that is more than `most`. */
static int divide(const clt_scene_description *description, const clt_sights *sights, double side, int most,
                  clt_division *divisions) {
  double count = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    const clt_rectangle *surface = &description->surfaces[k];
    double columns = fmin(fmax(1.0, ceil(vec_length(surface->u) / side - 1e-9)), most);
    double rows = fmin(fmax(1.0, ceil(vec_length(surface->v) / side - 1e-9)), most);
    if (surface->triangle) {
      columns = rows = fmax(columns, rows);
    }
    if (!sights->exchange[k]) {
      columns = rows = 0.0;
    }
    divisions[k] = (clt_division){(int)columns, (int)rows, (int)count, surface->triangle};
    count = fmin(count + columns * rows, most + 1.0);
  }
  return (int)count;
}

int clt_divide(const clt_scene_description *description, const clt_sights *sights, double footprint, clt_mesh_size size,
               clt_division *divisions) {
  double area = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    area += sights->exchange[k] ? clt_rectangle_area(&description->surfaces[k]) : 0.0;
  }
  double side = sqrt(fmin(footprint, area / size.wanted));
  int count = divide(description, sights, side, size.most, divisions);
  while (count > size.most) {
    side *= 1.02;
    count = divide(description, sights, side, size.most, divisions);
  }
  return count;
}

/* The number of a triangle's first element in row `row`. */
static int row_start(const clt_division *of, int row) {
  return row * (2 * of->columns - row);
}

int clt_division_element(const clt_division *of, double s, double t) {
  double x = fmax(s, 0.0) * of->columns, y = fmax(t, 0.0) * of->rows;
  int row = (int)fmin(y, of->rows - 1);
  if (!of->triangle) {
    return of->first + row * of->columns + (int)fmin(x, of->columns - 1);
  }
  int last = of->columns - 1 - row, column = (int)fmin(x, last);
  bool turned = column < last && (x - column) + (y - row) > 1.0;
  return of->first + row_start(of, row) + 2 * column + turned;
}

clt_rectangle clt_division_part(const clt_rectangle *whole, const clt_division *by, int number) {
  clt_rectangle part = *whole;
  part.u = vec_scale(1.0 / by->columns, whole->u);
  part.v = vec_scale(1.0 / by->rows, whole->v);
  int row = number / by->columns, column = number % by->columns;
  if (by->triangle) {
    for (row = 0; row_start(by, row + 1) <= number;) {
      row++;
    }
    bool turned = (number - row_start(by, row)) % 2 != 0;
    column = (number - row_start(by, row)) / 2 + turned;
    row += turned;
    if (turned) {
      part.u = vec_scale(-1.0, part.u);
      part.v = vec_scale(-1.0, part.v);
    }
  }
  part.corner = vec_along(whole->corner, column / (double)by->columns, whole->u, row / (double)by->rows, whole->v);
  return part;
}
