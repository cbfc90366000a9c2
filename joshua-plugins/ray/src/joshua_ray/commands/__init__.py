"""Commands of ``joshua`` that this distribution adds."""
