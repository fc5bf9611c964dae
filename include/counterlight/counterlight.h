/* counterlight: measure how a room carries light, invert it, and project the picture that makes the wanted one appear.
 */
#ifndef COUNTERLIGHT_H
#define COUNTERLIGHT_H

#include "counterlight/acquire.h"
#include "counterlight/analysis.h"
#include "counterlight/bench.h"
#include "counterlight/calibration.h"
#include "counterlight/device.h"
#include "counterlight/forward.h"
#include "counterlight/frames.h"
#include "counterlight/image.h"
#include "counterlight/live.h"
#include "counterlight/loop.h"
#include "counterlight/panel.h"
#include "counterlight/replay.h"
#include "counterlight/rig.h"
#include "counterlight/scene.h"
#include "counterlight/solve.h"
#include "counterlight/station.h"
#include "counterlight/status.h"
#include "counterlight/tradeoff.h"
#include "counterlight/transport.h"

#endif
