"""Nouns and mathematics that every room speaks."""
