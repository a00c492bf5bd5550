"""Campaigns: thousands of sampled scenarios on one machine or many, and what they say about robustness.

`spec` is what a campaign's file says, `sampling` turns it into scenarios, `trial` runs one, `cluster` runs all of them
on dask, `store` keeps the rows, `statistics` and `sensitivity` judge them, `command` is the order in which it happens.
"""
