/* The factors of far light in a file: docs/transport-file.md, /hierarchy/left and what goes with it. */
#ifndef CLT_TRANSPORT_HIERARCHY_FACTORS_H
#define CLT_TRANSPORT_HIERARCHY_FACTORS_H

#include "transport/hierarchy.h"

/* Into storage that knows its leaves; it knows its rank afterwards. */
clt_status clt_hierarchic_load_factors(clt_transport *transport, const clt_hdf *hdf, clt_error *error);
clt_status clt_hierarchic_save_factors(const clt_transport *transport, const clt_hdf *hdf, clt_error *error);
/* Every number is finite. */
clt_status clt_hierarchic_check_factors(const clt_transport *transport, const char *source, clt_error *error);

#endif
