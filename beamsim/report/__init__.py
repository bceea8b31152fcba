"""Results as pages that open in a browser without a network.

Never here: physics, result files.
Begin with `beamsim.report.page`; `beamsim.report.contents` says what a page holds.
"""
