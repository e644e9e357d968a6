"""Telemetry that only shows settings or durations: which field shows what."""

#: Telemetry that shows a setting: (telemetry field, setting telecommand, its field).
SETTINGS_SHOWN: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Exposure": (("exposure", "Exposure", "exposure"),),
    "FocalLengthDetails": (
        ("FocalLength", "setFocalLength", "FocalLength"),
        ("Fx", "setFocalLengthComponents", "Fx"),
        ("Fy", "setFocalLengthComponents", "Fy"),
    ),
    "PrincipalPoint": (("Cx", "setPrincipalPoint", "Cx"), ("Cy", "setPrincipalPoint", "Cy")),
    "DistortionCoef": (
        ("K1", "setRadialDistortionGains", "K1"),
        ("K2", "setRadialDistortionGains", "K2"),
        ("P1", "setTangentalDistortionGains", "P1"),
        ("P2", "setTangentalDistortionGains", "P2"),
    ),
    "DetectionRegion": tuple(
        (name, "setDetectionRegion", name)
        for name in ("StepSize", "Xstart", "Xend", "Ystart", "Yend")
    ),
    "StarPixels": tuple((name, "setStarPixels", name) for name in ("MinPixels", "MaxPixels")),
    "StarGrid": (("GridSize", "setDetectionVariables", "GridSize"),),
    "MaxStars": (
        ("maxStars", "setDetectionVariables", "MaxStars"),
        ("maxInvalidStars", "setDetectionVariables", "MaxInvalidStars"),
        ("maxNoise", "setDetectionVariables", "MaxNoise"),
    ),
    "IDMode": (("Mode", "setIDMode", "IdMode"),),
    "IDMargin": (("Margin", "setIDMargin", "Margin"),),
    "DelayTime": (("Timeout", "setDelayTimerTimeout", "Time"),),
}

#: Telemetry that shows times in ms: (field, step of Processing, longest or latest).
TIMES_SHOWN: dict[str, tuple[tuple[str, str, bool], ...]] = {
    "DetectionTimingOne": (
        ("MaxStarSearchTime", "search", True),
        ("MaxCentroidFindTime", "centroid", True),
        ("MaxCorrectionTime", "correction", True),
        ("MaxVectorCalTime", "vectors", True),
    ),
    "DetectionTimingTwo": (
        ("StarDetectionTime", "detection", False),
        ("MaxStarDetectionTime", "detection", True),
    ),
    "IDTimingOne": (
        ("MaxModeSelectionTime", "reduction", True),
        ("MaxDistanceCalTime", "distances", True),
        ("MaxVoteRoundOneTime", "votes", True),
        ("MaxFindIDTime", "identities", True),
    ),
    "IDTimingTwo": (
        ("MaxVoteRoundTwoTime", "verification", True),
        ("MaxSelectID", "selection", True),
        ("MaxAlgoCompletionTime", "identification", True),
    ),
    "IDTimingThree": (
        ("StarIdentificationTime", "identification", False),
        ("MaxStarIdentificationTime", "identification", True),
    ),
    "BestStarSelectionTime": (("LatestTime", "best", False), ("MaxTime", "best", True)),
    "AttitudeTiming": (("LatestTime", "attitude", False), ("MaxTime", "attitude", True)),
}
