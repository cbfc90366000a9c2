"""Commands of ``joshua`` that come with policies."""
