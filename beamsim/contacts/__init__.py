"""Contact laws, their static equilibrium with preloads, and their dependence on parameters.

Never here: the kind of structure at a contact.
Begin with `laws`, then `contacts`, the contacts of a system; `snubbers` and `springs` create them.
"""
