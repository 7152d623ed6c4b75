"""The model in another language: functions written in JAX, told to CasADi operation by operation."""
