#!/bin/bash
# Run a command where ROS 2, the environment of the package and the package are known.
set -e
source /opt/ros/jazzy/setup.bash
source /opt/lmsco_ros/src/lmsco_ros/.venv/bin/activate
source /opt/lmsco_ros/install/setup.bash
exec "$@"
