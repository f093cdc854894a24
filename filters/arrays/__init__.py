"""Methods for arrays of accelerometers: angular rate, planar and spatial orientation, calibration."""
