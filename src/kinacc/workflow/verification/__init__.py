"""Is a results folder whole, as the contract says, and made from one another?"""
