"""The model in another language: functions written in JAX, translated to CasADi operation by operation."""
