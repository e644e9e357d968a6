"""`cubestack fidelity`: published figures beside ours."""
