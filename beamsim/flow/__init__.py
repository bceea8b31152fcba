"""Motion in closed form: contact states, the certified march, derivatives; time stepping as a check.

Never here: pydantic, files, units, or the names of scenario keys, in messages either.
Begin with `transient`, the host loop `March`, and the kernel it calls, `kernels.march`.
"""
