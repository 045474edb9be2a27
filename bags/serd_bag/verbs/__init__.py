"""What is done with sound recordings: cut, merge, compare, print, index anew."""
