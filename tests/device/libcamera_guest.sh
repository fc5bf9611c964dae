#!/bin/sh
# In the guest: checks the libcamera driver on the simulated USB camera and on vimc.
#   libcamera_guest.sh PROBE SIMULATED_CAMERA LIBCAMERA_USB
set -eu
probe=$1 simulated=$2 usb=$3

modprobe vhci-hcd
modprobe uvcvideo
. "$usb" # libcamera wants a firmware node above a USB camera
"$simulated" -f 30 &
camera=$!
name=VHCI-1:1.0-1d6b:0104

echo "== USB camera"
"$probe" $name return
"$probe" $name frames
"$probe" $name exposure /dev/video0
"$probe" $name cycles
"$probe" $name unplug $camera
wait $camera || true
(sleep 1; exec "$simulated" -f 30) &
"$probe" $name return

echo "== vimc"
modprobe vimc
"$probe" "Sensor B" return
"$probe" "Sensor B" frames
"$probe" "Sensor B" cycles
