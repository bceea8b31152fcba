"""Contact laws, their statics (equilibrium, preload) and how they change with a parameter.

Never here: which kind of structure a contact sits on.
Begin with `laws`, then `contacts`, which holds those of a system; `snubbers` and `springs` make them.
"""
