"""Results as pages that open in a browser without a network.

Read `beamsim.report.page` first. Pictures come from `beamsim.plots`, tables from who calls; nothing is computed here.
"""
