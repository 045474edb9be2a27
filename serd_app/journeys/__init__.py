"""What a front end does by one call: from files and settings to a record of what was made."""
