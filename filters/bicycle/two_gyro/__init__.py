"""Roll of a bicycle and attitude of the trunk from two gyroscopes and a camera."""
