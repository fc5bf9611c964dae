/* What a method is expected to take on every channel of a transport. */
#ifndef CLT_SOLVE_FORECAST_H
#define CLT_SOLVE_FORECAST_H

#include "solve/method.h"

/* As clt_forecast_solve, of options that were checked. */
void clt_forecast_method(const clt_method *method, const clt_certificate *certificate, const clt_transport_info *info,
                         const clt_solve_options *options, clt_forecast *out);

#endif
