"""The identified model in the forms that control design and simulation expect."""
