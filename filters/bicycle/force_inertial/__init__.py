"""Roll of a bicycle and angles of the trunk from inertial and force sensors."""
